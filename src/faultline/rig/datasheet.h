// The datasheet of a rig: config/<rig>/rig.yaml with stages.yaml beside it, read strictly. It fixes the nominal model's
// numbers, names and places, and names the stages that diagnose the rig. One schema for all rigs (docs/datasheet.md);
// unknown or missing keys, wrong types and values out of range are InputErrors that name the file, the line, the key
// and what is allowed.
#pragma once

#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "faultline/rig/port.h"
#include "faultline/signal/channel.h"

namespace faultline {

struct Parameter {
  std::string name;
  std::string symbol;
  std::string unit;
  double nominal = 0;
  double tolerance = 0;   // relative, one sigma, between this rig and the datasheet; exact where 0
  std::string from;       // where the number comes from
  bool identify = false;  // `faultline fit` estimates it
};

struct State {
  std::string name;
  std::string symbol;
  std::string unit;
  int channel = -1;  // that measures this state and nothing else, where fits and the gap start a segment; -1: none
};

// A named set of numbers, for what has settings but no structure of its own: a controller's gains, a profile's shape, a
// stage's settings. Numbers, lists of numbers and words are kept apart; a reader takes what it knows with
// Settings::number and the like and calls check_used(), which refuses what nobody asked for.
class Settings {
 public:
  Settings() = default;
  Settings(std::string where, std::map<std::string, double> numbers, std::map<std::string, std::vector<double>> lists,
           std::map<std::string, std::string> words);

  // Throw InputError where the key is missing, or the value is not finite or outside [minimum, maximum].
  double number(const std::string& key, double minimum, double maximum) const;
  double number_or(const std::string& key, double fallback, double minimum, double maximum) const;
  std::vector<double> list(const std::string& key, std::size_t size, double minimum,
                           double maximum) const;  // size 0: any
  std::string word(const std::string& key) const;
  std::string word_or(const std::string& key, const std::string& fallback) const;
  bool has(const std::string& key) const;
  void check_used() const;                             // InputError if a key was never asked for
  const std::string& where() const { return where_; }  // file and key path, for messages
  void set(const std::string& key, double value);      // overrides one number (tuning, command line)
  void set(const std::string& key, const std::vector<double>& values);
  void set(const std::string& key, const std::string& word);
  // Every entry as a datasheet has it, `key: value`, by key.
  std::vector<std::string> texts() const;

 private:
  std::string where_;
  std::map<std::string, double> numbers_;
  std::map<std::string, std::vector<double>> lists_;
  std::map<std::string, std::string> words_;
  mutable std::map<std::string, bool> used_;
};

// A command that follows an excitation by itself, in the channel's unit.
struct DrivenCommand {
  std::string channel;
  std::string shape;  // of rig/excitation.h
  Settings settings;  // that shape's
};

// What a rig is asked for during a run. With a controller: `controller` names an entry of Datasheet::controllers;
// `shape` one of the excitation shapes of rig/excitation.h; `settings` are that shape's. Open loop: no controller, and
// `commands` are driven.
struct Profile {
  std::string name;
  std::string controller;
  std::string shape;
  std::vector<DrivenCommand> commands;
  double duration = 0;  // s, when the command line gives none
  std::string meaning;
  Settings settings;
  std::string second_shape;  // of a second raw set point; empty: there is none
  Settings second_settings;
  std::map<std::string, double> inputs;  // value of measured inputs during this profile, where not the rig's
};

// How a simulator makes a measured input when no recording gives it: value + wander (band-limited noise) at the sensor.
struct InputSignal {
  std::string channel;
  double value = 0;
  double wander_std = 0;     // in the channel's unit
  double wander_low = 0.05;  // Hz
  double wander_high = 1;    // Hz
};

// A command that follows a table of (time, value), linear in between; for what no controller moves (a leak valve).
struct CommandTable {
  std::string channel;
  std::vector<double> time;   // s
  std::vector<double> value;  // in the channel's unit
};

// A named fault scenario.
struct Fault {
  std::string name;
  std::string meaning;
  std::vector<std::string> effects;  // effect@port:name=value,...,from=,to=
  std::vector<CommandTable> commands;
  std::string profile;  // which excitation it is shown with; empty: any
};

// One stage of the diagnosis (an estimator, a detector, an isolator), by kind and name of its type.
struct StageSpec {
  std::string name;  // of this stage, unique in the rig
  std::string type;  // of the estimator, detector, ...
  Settings settings;
};

struct Lookup {  // a table of a rig: one or more columns over a grid
  std::string name;
  std::map<std::string, std::vector<double>> columns;
};

struct Datasheet {
  std::string file;         // rig.yaml, or a single file that holds the stages too
  std::string stages_file;  // stages.yaml beside it; empty: there is none
  std::string rig;
  std::string title;
  std::string source;
  double sample_period = 0;           // s
  double segment = 0;                 // s, over which the model runs from measured states; 0: from its time scales
  std::vector<std::string> branches;  // expanded in the names below; empty for most rigs
  std::vector<Channel> channels;
  std::vector<Channel> not_recorded;  // internal variables that a simulator can show
  std::vector<State> states;
  std::vector<Parameter> parameters;
  std::map<std::string, double> constants;
  std::vector<Lookup> tables;
  std::vector<Port> ports;
  std::vector<InputSignal> inputs;
  std::map<std::string, Settings> controllers;
  std::vector<Profile> profiles;
  std::vector<Fault> faults;
  std::vector<std::string> nuisance;         // small effects that every rig recording carries, as effect@port:...
  std::vector<std::string> nominal_effects;  // effects that the nominal model has adopted, as effect@port:...
  std::vector<StageSpec> estimators;
  std::vector<StageSpec> detectors;
  std::vector<StageSpec> isolators;
  std::map<std::string, double> normal_gap;  // channel -> largest excess that is normal on this rig
  std::vector<std::string> notes;
  // Keys at the top that were filled in because the datasheet leaves them out (default_sheet.h).
  std::set<std::string> defaulted;

  // Where an entry stands, as FILE:LINE: 'path': "ports.force.piston", or a section, "ports". Empty in a sheet that was
  // not read.
  std::map<std::string, std::string> places;
  std::string place(const std::string& entry) const;  // the file where there is none
  // What the look-ups below and EffectSet were asked for, as "ports.force.piston", while check_datasheet() watches;
  // else null.
  std::shared_ptr<std::set<std::string>> asked;

  // Throw InputError that names the datasheet and lists what there is.
  const Port& port(const std::string& name) const;
  int channel(const std::string& name) const;
  int parameter(const std::string& name) const;
  const Profile& profile(const std::string& name) const;
  const Fault& fault(const std::string& name) const;
  std::size_t estimator(const std::string& name) const;  // its place among the estimators
  std::vector<double> nominal() const;                   // parameter values in order
};

// Reads and checks one datasheet: a folder with rig.yaml and, where the rig is diagnosed, stages.yaml; or that
// rig.yaml; or a single file of another name that holds both.
Datasheet read_datasheet(const std::string& path);

// The datasheets of all rigs in a folder (RIG/rig.yaml), sorted by rig.
std::vector<Datasheet> read_datasheets(const std::string& folder);

// The datasheet of `rig` in the folder (RIG/rig.yaml); InputError that lists the rigs there are.
Datasheet find_datasheet(const std::string& folder, const std::string& rig);

}  // namespace faultline
