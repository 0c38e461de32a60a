#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "faultline/signal/error.h"
#include "faultline/signal/units.h"

namespace faultline {
namespace {

constexpr double kPi = 3.14159265358979323846;

struct Case {
  const char* from;
  const char* to;
  double value;
  double expected;
};

TEST(Units, ConvertsWhatTestStandsUse) {
  const Case cases[] = {
      {"bar", "Pa", 2.5, 2.5e5},
      {"mbar", "Pa", 1, 100},
      {"kPa", "Pa", 3, 3e3},
      {"MPa", "Pa", 7, 7e6},
      {"psi", "Pa", 1000, 6894757.293168361},
      {"mm", "m", 12, 0.012},
      {"cm", "m", 12, 0.12},
      {"um", "m", 5, 5e-6},
      {"rpm", "rad/s", 1500, 50 * kPi},
      {"rev/s", "rad/s", 2, 4 * kPi},
      {"deg", "rad", 180, kPi},
      {"deg/s", "rad/s", 90, kPi / 2},
      {"l/s", "m^3/s", 4, 4e-3},
      {"l/min", "m^3/s", 60, 1e-3},
      {"ml/s", "m^3/s", 8, 8e-6},
      {"gpm", "m^3/s", 1, 6.309019640343866e-5},
      {"cm^3/min", "m^3/s", 60, 1e-6},
      {"degC", "K", 20, 293.15},
      {"degF", "K", 212, 373.15},
      {"K", "degC", 273.15, 0},
      {"kN", "N", 1.2, 1200},
      {"N/mm", "N/m", 5, 5000},
      {"kN m", "N m", 2, 2000},
      {"J", "N m", 3, 3},
      {"mV", "V", 250, 0.25},
      {"mA", "A", 20, 0.02},
      {"ms", "s", 5, 0.005},
      {"min", "s", 2, 120},
      {"kg/h", "kg/s", 3600, 1},
      {"g/s", "kg/s", 500, 0.5},
      {"t", "kg", 2, 2000},
      {"%", "1", 45, 0.45},
      {"m/(s*s)", "m/s^2", 9, 9},
      {"m s^-1", "m/s", 9, 9},
      {"m^3/(s Pa)", "l/(s bar)", 1e-8, 1},
      {"m^3/(s V sqrt(Pa))", "l/(s V bar^0.5)", 1e-8, 1e-5 * std::sqrt(1e5)},
      {"kg^0.875/(s^0.875 Pa^0.5)", "(kg/s)^0.875 sqrt(1/Pa)", 0.0042, 0.0042},
  };
  for (const Case& c : cases) {
    const double result = conversion(c.from, c.to)(c.value);
    EXPECT_NEAR(result, c.expected, 1e-12 * std::max(1.0, std::abs(c.expected))) << c.from << " -> " << c.to;
    EXPECT_NEAR(conversion(c.to, c.from)(result), c.value, 1e-9 * std::max(1.0, std::abs(c.value)))
        << c.to << " -> " << c.from;
  }
}

TEST(Units, SameTextIsExact) {
  const Conversion same = conversion("m^3/(s V sqrt(Pa))", "m^3/(s V sqrt(Pa))");
  EXPECT_EQ(same.scale, 1);
  EXPECT_EQ(same.offset, 0);
  EXPECT_EQ(same(0.1), 0.1);
}

TEST(Units, SiUnitsAreToldFromOthers) {
  for (const char* text : {"1", "m", "kg", "kg/s", "N m", "Pa", "rad/s", "kg m^2", "m^3/(s V sqrt(Pa))"})
    EXPECT_TRUE(is_si(parse_unit(text))) << text;
  for (const char* text : {"mm", "g", "bar", "degC", "%", "rpm", "gpm/psi^0.5"})
    EXPECT_FALSE(is_si(parse_unit(text))) << text;
}

TEST(Units, DifferentThingsDoNotConvert) {
  const char* pairs[][2] = {{"bar", "m"}, {"Hz", "rad/s"}, {"rpm", "Hz"}, {"kg", "N"},
                            {"l", "l/s"}, {"1", "V"},      {"mA", "V"},   {"sqrt(Pa)", "Pa"}};
  for (const auto& pair : pairs) {
    try {
      conversion(pair[0], pair[1]);
      ADD_FAILURE() << pair[0] << " became " << pair[1];
    } catch (const InputError& error) {
      const std::string text = error.what();
      EXPECT_NE(text.find(std::string("'") + pair[0] + "'"), std::string::npos) << text;
      EXPECT_NE(text.find(std::string("'") + pair[1] + "'"), std::string::npos) << text;
      EXPECT_EQ(text.find('\n'), std::string::npos);
    }
  }
}

TEST(Units, NonsenseIsRefused) {
  for (const char* text : {"",           " ",      "furlong", "m//s",   "m^",
                           "m^x",        "m^99",   "m^0.5x",  "sqrt(m", "sqrt m",
                           "sqrt(degC)", "(m",     "m)",      "^2",     "/s",
                           "degC/s",     "m degC", "degC^2",  "kmin",   "((((((((((((((((((((((((m"}) {
    EXPECT_THROW(parse_unit(text), InputError) << "'" << text << "'";
  }
}

}  // namespace
}  // namespace faultline
