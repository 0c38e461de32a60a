// Copies of the shipped datasheets with one mistake each: every misspelt name, effect, unit and every line that
// contradicts the equations is refused with one line that names the file and the line.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <regex>
#include <string>
#include <vector>

#include "faultline/rig/datasheet.h"
#include "faultline/rig/nearest_name.h"
#include "faultline/rig/rig.h"
#include "faultline/signal/error.h"
#include "rigs/servo_actuator/runs.h"

namespace faultline {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> lines_of(const std::string& file) {
  std::ifstream stream(file);
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

// A copy of one rig's folder whose rig.yaml or stages.yaml may be changed line by line.
class Copy {
 public:
  explicit Copy(const std::string& rig)
      : folder_(fs::temp_directory_path() / fmt::format("faultline_sheet_{}_{}", ::getpid(), rig)) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    for (const char* name : {"rig.yaml", "stages.yaml"})
      if (fs::exists(fs::path(config_folder()) / rig / name))
        fs::copy_file(fs::path(config_folder()) / rig / name, folder_ / name);
  }
  ~Copy() { fs::remove_all(folder_); }
  Copy(const Copy&) = delete;
  Copy& operator=(const Copy&) = delete;

  std::string file(const std::string& name = "rig.yaml") const { return (folder_ / name).string(); }

  // What reading says when line `number` (from 1) is another; empty if nothing.
  std::string said_with(std::size_t number, const std::string& line, const std::string& name = "rig.yaml") const {
    const std::vector<std::string> lines = lines_of(file(name));
    write(lines, number, line, name);
    std::string said;
    try {
      read_datasheet(folder_.string());
    } catch (const InputError& error) {
      said = error.what();
    }
    write(lines, number, lines[number - 1], name);
    return said;
  }

  // The first line that holds `text`, from 1.
  std::size_t line_with(const std::string& text, const std::string& name = "rig.yaml") const {
    const std::vector<std::string> lines = lines_of(file(name));
    for (std::size_t i = 0; i < lines.size(); ++i)
      if (lines[i].find(text) != std::string::npos) return i + 1;
    ADD_FAILURE() << "no line with " << text;
    return 1;
  }

  // The first line that holds `from` gets `to` in its place. Expects a refusal at `at` (0: that line) that holds
  // `says`.
  void expect(const std::string& from, const std::string& to, const std::string& says, std::size_t at = 0,
              const std::string& name = "rig.yaml") const {
    const std::size_t number = line_with(from, name);
    std::string line = lines_of(file(name))[number - 1];
    line.replace(line.find(from), from.size(), to);
    const std::string said = said_with(number, line, name);
    EXPECT_EQ(said.rfind(fmt::format("{}:{}:", file(name), at > 0 ? at : number), 0), 0u) << said;
    EXPECT_NE(said.find(says), std::string::npos) << said;
    EXPECT_EQ(said.find('\n'), std::string::npos) << said;
  }

 private:
  void write(std::vector<std::string> lines, std::size_t number, const std::string& line,
             const std::string& name) const {
    lines[number - 1] = line;
    std::ofstream stream(file(name));
    for (const std::string& one : lines) stream << one << '\n';
  }

  fs::path folder_;
};

TEST(DatasheetCheck, HoldsPortsAgainstTheEquations) {
  const Copy servo("servo_actuator");
  EXPECT_EQ(servo.said_with(1, "# as it is"), "");
  servo.expect("line.valve_cylinder:", "line.valve_cylindr:", "did you mean 'line.valve_cylinder'?");
  servo.expect(
      "  transmission.rod:",
      "  heat.rod: {component: x, meaning: x, effects: {heat_loss: {coefficient: [0, 1]}}}\n  transmission.rod:",
      "never ask for: an effect there would do nothing");
  // A port that is left out: at the section, since no other is near.
  const std::size_t line = servo.line_with("  line.valve_cylinder:");
  const std::string said = servo.said_with(line, "  line.elsewhere:");
  EXPECT_EQ(said.rfind(fmt::format("{}:{}: 'ports' lacks the port 'line.valve_cylinder'", servo.file(),
                                   servo.line_with("ports:")),
                       0),
            0u)
      << said;
}

TEST(DatasheetCheck, HoldsChannelsParametersAndStatesAgainstTheEquations) {
  const Copy servo("servo_actuator");
  servo.expect("name: ram_area", "name: ram_aera", "did you mean 'ram_area'?");
  servo.expect("  - {name: ram_area",
               "  - {name: oil_mass, symbol: m, unit: kg, nominal: 1, tolerance: 0.1, from: x}\n  - {name: ram_area",
               "'oil_mass', a parameter that the equations of servo_actuator never ask for");
  servo.expect(
      "  - {name: load_pressure",
      "  - {name: oil_level, symbol: h, unit: m, role: output, range: [0, 1], noise_std: 0, resolution: 0, meaning: "
      "x}\n  - {name: load_pressure",
      "never ask for; what is measured and not predicted has the role input");
  // An input may be measured only to be watched; an exact parameter may serve people only.
  const std::size_t channel = servo.line_with("  - {name: load_pressure");
  EXPECT_EQ(
      servo.said_with(channel,
                      "  - {name: oil_level, symbol: h, unit: m, role: input, range: [0, 1], noise_std: 0, resolution: "
                      "0, meaning: x}\n" +
                          lines_of(servo.file())[channel - 1]),
      "");
  const std::size_t area = servo.line_with("  - {name: ram_area");
  EXPECT_EQ(servo.said_with(area, "  - {name: oil_mass, symbol: m, unit: kg, nominal: 1, tolerance: 0, from: x}\n" +
                                      lines_of(servo.file())[area - 1]),
            "");
  servo.expect("  load_force: {value: 0", "#", "has no entry under 'inputs'",
               servo.line_with("{name: load_force, symbol"));
  servo.expect("- {name: leak_spool,", "- {name: leak_spol,", "have 'leak_spool' there");
  servo.expect("- {name: velocity, symbol: v, unit: m/s, measured_by: velocity, initial: 0}", "#",
               "have 'velocity' there",
               servo.line_with("- {name: chamber_a_pressure, symbol: p_a, unit: Pa, measured_by"));
  servo.expect("measured_by: chamber_a_pressure", "measured_by: load_pressure", "shows something else");
  servo.expect("name: leak_spool, symbol: x_leak, unit: V",
               "name: leak_spool, symbol: x_leak, unit: V, measured_by: velocity", "in m/s, but the state is in V");
}

TEST(DatasheetCheck, MakesEveryController) {
  const Copy servo("servo_actuator");
  servo.expect("    setpoint_pole: 40", "    setpoint_pol: 40", "'setpoint_pole' is missing",
               servo.line_with("  position_control:"));
  servo.expect("    setpoint_pole: 40", "    setpoint_pole: 40\n    damping: 2", "key 'damping' is not known",
               servo.line_with("  position_control:"));
  servo.expect("  open_loop:", "  opn_loop:", "controllers are opn_loop, position_control; did you mean 'opn_loop'?",
               servo.line_with("controller: open_loop"));
  servo.expect("  open_loop:", "  closed: {gain: 1}\n  open_loop:", "this build does not have for servo_actuator");
  servo.expect("name: position_reference", "name: position_refrence", "did you mean 'position_reference'?");
}

TEST(DatasheetCheck, HoldsWhatDetectorsClaimAgainstThePorts) {
  const Copy servo("servo_actuator");
  servo.expect("port: flow.chamber_a_chamber_b", "port: flow.chamber_a_chamber",
               "did you mean 'flow.chamber_a_chamber_b'?", servo.line_with("- name: internal_leak", "stages.yaml"),
               "stages.yaml");
}

// Changes one character at `at`, such that a name stays a name and is no longer the same.
std::string misspelt(std::string line, std::size_t end) {
  const std::size_t last = end - 1;
  line[last] = line[last] == 'x' ? 'y' : 'x';
  return line;
}

struct Refusals {
  int tried = 0, refused = 0, elsewhere = 0;
};

// Misspells what `pattern` captures, wherever it stands in the lines of `section`, once in turn.
Refusals misspell(const Copy& copy, const std::string& section, const std::regex& pattern) {
  Refusals all;
  const std::vector<std::string> lines = lines_of(copy.file());
  bool inside = false;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (!lines[i].empty() && lines[i][0] != ' ' && lines[i][0] != '#') inside = lines[i].rfind(section + ":", 0) == 0;
    if (!inside) continue;
    const std::string code = lines[i].substr(0, lines[i].find(" #"));
    for (std::sregex_iterator found(code.begin(), code.end(), pattern), end; found != end; ++found) {
      const auto last = static_cast<std::size_t>(found->position(1) + found->length(1));
      const std::string said = copy.said_with(i + 1, misspelt(lines[i], last));
      ++all.tried;
      if (said.empty()) continue;
      ++all.refused;
      SCOPED_TRACE((*found)[1].str() + ": " + said);
      EXPECT_EQ(said.rfind(copy.file() + ":", 0), 0u);
      EXPECT_EQ(said.find('\n'), std::string::npos);
      all.elsewhere += std::atoi(said.c_str() + copy.file().size() + 1) != static_cast<int>(i + 1);
    }
  }
  return all;
}

class EveryDatasheet : public ::testing::TestWithParam<std::string> {
 protected:
  Copy copy_{GetParam()};
  bool has_equations_ = find_rig_type(GetParam()) != nullptr;
};

TEST_P(EveryDatasheet, MisspeltEffectsAndTheirParametersAreRefusedWhereTheyStand) {
  const Refusals effects = misspell(copy_, "ports", std::regex(R"(([a-z_]+): \{[a-z_]+: \[)"));
  const Refusals parameters = misspell(copy_, "ports", std::regex(R"(([a-z_]+): \[)"));
  EXPECT_GT(effects.tried, 20);
  EXPECT_EQ(effects.refused, effects.tried);
  EXPECT_EQ(effects.elsewhere, 0);
  EXPECT_EQ(parameters.refused, parameters.tried);
  EXPECT_EQ(parameters.elsewhere, 0);
}

TEST_P(EveryDatasheet, MisspeltUnitsAreRefusedWhereTheyStand) {
  for (const char* section : {"channels", "states", "parameters", "constants"}) {
    const Refusals units = misspell(copy_, section, std::regex(R"rx(unit: "?([^",}]+))rx"));
    SCOPED_TRACE(section);
    EXPECT_GT(units.tried, std::string(section) == "constants" ? -1 : 3);
    EXPECT_EQ(units.refused, units.tried);
    EXPECT_EQ(units.elsewhere, 0);
  }
}

TEST_P(EveryDatasheet, MisspeltNamesAreRefused) {
  const std::regex name(R"rx(name: "?([a-z0-9_{}]+))rx");
  const Refusals states = misspell(copy_, "states", name);
  const Refusals measured = misspell(copy_, "states", std::regex(R"rx(measured_by: ([a-z0-9_]+))rx"));
  const Refusals parameters = misspell(copy_, "parameters", name);
  const Refusals channels = misspell(copy_, "channels", name);
  const Refusals ports = misspell(copy_, "ports", std::regex(R"rx(^  "?([a-z]+\.[a-z0-9_{}]+)"?:)rx"));
  EXPECT_EQ(measured.refused, measured.tried);
  EXPECT_EQ(measured.elsewhere, 0);
  EXPECT_GT(ports.tried, 15);
  if (!has_equations_) return;
  EXPECT_EQ(states.refused, states.tried);
  EXPECT_EQ(states.elsewhere, 0);
  // An exact parameter that serves people only may be called anything.
  EXPECT_GE(parameters.refused, parameters.tried - 1);
  EXPECT_EQ(parameters.elsewhere, 0);
  EXPECT_EQ(channels.refused, channels.tried);
  EXPECT_EQ(ports.refused, ports.tried);
}

std::vector<std::string> shipped_rigs() {
  std::vector<std::string> names;
  for (const Datasheet& sheet : read_datasheets(config_folder())) names.push_back(sheet.rig);
  return names;
}

INSTANTIATE_TEST_SUITE_P(Rigs, EveryDatasheet, ::testing::ValuesIn(shipped_rigs()));

TEST(NearestName, IsTheOneWithFewestEditsIfTheyAreFew) {
  const std::vector<std::string> names = {"position", "velocity", "load_pressure"};
  EXPECT_EQ(nearest_name("postion", names), "position");
  EXPECT_EQ(nearest_name("velocty", names), "velocity");
  EXPECT_EQ(nearest_name("loadpresure", names), "load_pressure");
  EXPECT_EQ(nearest_name("temperature", names), "");
  EXPECT_EQ(nearest_name("", names), "");
  EXPECT_EQ(did_you_mean("postion", names), "; did you mean 'position'?");
  EXPECT_EQ(did_you_mean("force", names), "");
}

}  // namespace
}  // namespace faultline
