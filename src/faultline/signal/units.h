// Units of measurement as people write them, and how to get from one to another.
//
// A unit is a product of symbols with powers: `m/s`, `l/min`, `kg m^2`, `m^3/(s sqrt(Pa))`, `kg^0.875`, `1`. Symbols
// are the SI's with the usual prefixes, and the common units of a hydraulic test stand (bar, psi, rpm, l, gal, deg,
// degC, ...). Every unit reduces to
//   SI value = scale * value + offset            (offset only for degC and degF, and only where they stand alone)
// over the dimensions metre, kilogram, second, ampere, kelvin and radian. The radian counts as a dimension of its own
// so that Hz is not taken for rad/s. Factors: BIPM, The International System of Units, 9th edition; NIST SP 811 for
// psi, lbf, gal, inch. Fails with InputError where a symbol is not known, the expression cannot be read, or the
// dimensions differ.
#pragma once

#include <array>
#include <string>

namespace faultline {

struct Unit {
  std::array<double, 6> dimension{};  // powers of m, kg, s, A, K, rad
  double scale = 1;
  double offset = 0;
};

// InputError that names the text and lists what there is.
Unit parse_unit(const std::string& text);

// Whether a value in this unit is its SI value (m, kg, s and what follows from them; neither mm nor degC).
bool is_si(const Unit& unit);

struct Conversion {
  double scale = 1;
  double offset = 0;
  double operator()(double value) const { return scale * value + offset; }
};

// From one unit to another; the same text gives exactly 1 and 0. InputError that names both if they measure different
// things.
Conversion conversion(const std::string& from, const std::string& to);

}  // namespace faultline
