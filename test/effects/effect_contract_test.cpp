// What every effect promises, checked on each registered type at each kind of port that it fits.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "effect_probe.h"
#include "faultline/signal/error.h"

namespace faultline {
namespace {

bool is_signal(PortKind kind) { return kind == PortKind::command || kind == PortKind::sensor; }

// Calls `check` for every type at every kind it fits, with a trace that names both.
template <class Check>
void visit_all(Check check) {
  for (const EffectType& type : effect_types())
    for (PortKind kind : type.fits) {
      SCOPED_TRACE(type.name + " at " + to_string(kind));
      check(type, kind);
    }
}

TEST(EffectContract, AllTypesAreRegisteredAndDescribed) {
  EXPECT_GE(effect_types().size(), 43u);
  std::set<std::string> names;
  for (const EffectType& type : effect_types()) {
    SCOPED_TRACE(type.name);
    EXPECT_TRUE(names.insert(type.name).second) << "registered twice";
    EXPECT_FALSE(type.family.empty());
    EXPECT_FALSE(type.meaning.empty());
    EXPECT_EQ(type.meaning.find('\n'), std::string::npos);
    for (const EffectParameter& p : type.parameters)
      EXPECT_TRUE(std::regex_search(type.meaning, std::regex("\\b" + p.name + "\\b")))
          << "the formula does not say what " << p.name << " does: " << type.meaning;
    ASSERT_FALSE(type.fits.empty());
    ASSERT_FALSE(type.parameters.empty());
    EXPECT_LE(type.parameters.size(), static_cast<std::size_t>(kMaximumEffectParameters));
    EXPECT_FALSE(typical_size(type.name).empty()) << "give the new effect a size in effect_probe.h";
    bool has_size = false;
    for (const EffectParameter& p : type.parameters) {
      EXPECT_FALSE(p.name.empty());
      EXPECT_FALSE(p.unit.empty());
      EXPECT_LT(p.minimum, p.maximum);
      if (std::isnan(p.none)) continue;
      has_size = true;
      EXPECT_GE(p.none, p.minimum);
      EXPECT_LE(p.none, p.maximum);
    }
    EXPECT_TRUE(has_size) << "no parameter can be without effect";
  }
}

TEST(EffectContract, SizeZeroChangesNothingAtAll) {
  visit_all([](const EffectType& type, PortKind kind) {
    Effect nothing;
    const auto effect = made(type, typical_parameters(type));
    const auto before = probe(nothing, kind);
    effect->set_size(0);
    effect->reset();
    EXPECT_EQ(probe(*effect, kind), before);
    // The same by parameters: every parameter that has a no-effect value at that value.
    auto none = typical_parameters(type);
    for (std::size_t i = 0; i < none.size(); ++i)
      if (!std::isnan(type.parameters[i].none)) none[i] = type.parameters[i].none;
    EXPECT_EQ(probe(*made(type, none), kind), before);
  });
}

TEST(EffectContract, TypicalSizeChangesSomethingAndFadesContinuously) {
  visit_all([](const EffectType& type, PortKind kind) {
    Effect nothing;
    const auto before = probe(nothing, kind);
    const auto effect = made(type, typical_parameters(type));
    const double full = largest_difference(probe(*effect, kind), before);
    EXPECT_GT(full, 0);
    double last = full;
    for (double size : {1e-2, 1e-4, 1e-6, 1e-9}) {
      effect->set_size(size);
      effect->reset();
      const double now = largest_difference(probe(*effect, kind), before);
      EXPECT_LE(now, last) << "size " << size;
      // Not in proportion: a little air already softens much at vacuum.
      EXPECT_LE(now, (size > 1e-6 ? 1 : size > 1e-9 ? 0.02 : 1e-4) * full) << "size " << size;
      last = now;
    }
  });
}

TEST(EffectContract, NeighbouringSizesGiveNeighbouringResults) {
  visit_all([](const EffectType& type, PortKind kind) {
    if (type.name == "stuck" || type.name == "quantisation") return;  // their steps move with the size
    Effect nothing;
    const auto effect = made(type, typical_parameters(type));
    const double full = largest_difference(probe(*effect, kind), probe(nothing, kind));
    for (double size : {0.1, 0.37, 0.8}) {
      effect->set_size(size);
      effect->reset();
      const auto here = probe(*effect, kind);
      effect->set_size(size * (1 + 1e-6));
      effect->reset();
      EXPECT_LE(largest_difference(probe(*effect, kind), here), 1e-3 * full) << "size " << size;
    }
  });
}

TEST(EffectContract, FiniteWithinAllBounds) {
  visit_all([](const EffectType& type, PortKind kind) {
    const std::size_t count = type.parameters.size();
    for (std::size_t corner = 0; corner < (1u << count); ++corner) {
      auto parameters = typical_parameters(type);
      for (std::size_t i = 0; i < count; ++i)
        parameters[i] = (corner >> i) & 1u ? type.parameters[i].maximum : type.parameters[i].minimum;
      const auto effect = made(type, parameters);
      for (double size : {1.0, 0.5, 1e-9, 0.0}) {
        effect->set_size(size);
        effect->reset();
        for (double out : probe(*effect, kind))
          ASSERT_TRUE(std::isfinite(out)) << "corner " << corner << " size " << size;
        for (double time : {0.0, 1e4})
          for (double value : {0.0, -3.0, 1e7}) {
            ASSERT_TRUE(std::isfinite(effect->signal(value, time)));
            // What a stuck sensor shows, and what lies at a limit, says nothing.
            ASSERT_FALSE(std::isinf(effect->undo_signal(value, time)));
          }
      }
    }
  });
}

TEST(EffectContract, ResetIsComplete) {
  visit_all([](const EffectType& type, PortKind kind) {
    const auto effect = made(type, typical_parameters(type));
    const auto first = probe(*effect, kind);
    for (int k = 0; k < 500; ++k) {  // leave something in every memory
      effect->signal(k % 7 - 20.0, 5 + k * kProbeStep);
      BodyForces forces;
      effect->force({0.3 * std::sin(0.1 * k), 0.1, 1e6}, forces);
    }
    effect->set_size(0.3);
    effect->set_size(1);
    effect->reset();
    EXPECT_EQ(probe(*effect, kind), first);
  });
}

TEST(EffectContract, SizeMayChangeWhileItRuns) {
  visit_all([](const EffectType& type, PortKind kind) {
    if (!is_signal(kind)) return;
    const auto effect = made(type, typical_parameters(type));
    effect->set_size(0);
    effect->reset();
    for (int k = 0; k < 2000; ++k) {
      const double time = k * kProbeStep;
      effect->set_size(k / 1999.0);
      ASSERT_TRUE(std::isfinite(effect->signal(probe_signal(time), time)));
      ASSERT_LT(std::fabs(effect->signal(probe_signal(time), time)), 5);
    }
  });
}

// On an input whose steps take 20 ms: where a jump falls on a delay's grid is a matter of luck, not of order.
TEST(EffectContract, HalvingTheStepConverges) {
  visit_all([](const EffectType& type, PortKind kind) {
    if (!is_signal(kind) || type.name == "noise") return;  // noise is white at any step
    const auto parameters = typical_parameters(type);
    std::vector<std::vector<double>> runs;
    for (int halvings = 0; halvings < 7; ++halvings) {
      const int every = 1 << halvings;
      runs.push_back(probe_signals(*made(type, parameters, kProbeStep / every), kProbeStep / every, every, 0.02));
    }
    std::vector<double> change;
    for (std::size_t i = 1; i < runs.size(); ++i) {
      double sum = 0;
      for (std::size_t k = 0; k < runs[i].size(); ++k) sum += std::fabs(runs[i][k] - runs[i - 1][k]);
      change.push_back(sum / static_cast<double>(runs[i].size()));
    }
    // First order, but not step by step: when a limited signal turns depends on where the grid lies.
    const double coarse = std::max(change[0], change[1]);
    EXPECT_LT(coarse, 0.02);
    EXPECT_TRUE(change[4] < 0.3 * coarse || coarse < 1e-12) << coarse << " " << change[4];
    EXPECT_TRUE(change[5] < 0.2 * coarse || coarse < 1e-12) << coarse << " " << change[5];
  });
}

// Whether what comes out depends on nothing but what goes in at the time.
bool forgets(const EffectType& type) {
  if (type.name == "noise") return false;  // nor does it say what went in
  const auto effect = made(type, typical_parameters(type)), other = made(type, typical_parameters(type));
  bool same = true;
  for (int k = 0; k < 200; ++k) {
    const double time = kProbeStep * k;
    effect->signal(probe_signal(time), time);
    other->signal(-probe_signal(0.7 * time), time);
    same = same && effect->signal(0.3, time) == other->signal(0.3, time);
  }
  return same;
}

// Start states come from what sensors show: every effect without memory says what must have gone in, or that nothing
// is known of it.
TEST(EffectContract, UndoReturnsWhatWentIn) {
  std::set<std::string> without_memory;
  visit_all([&](const EffectType& type, PortKind kind) {
    if (!is_signal(kind)) return;
    const auto effect = made(type, typical_parameters(type));
    const bool undone = forgets(type);
    if (undone) without_memory.insert(type.name);
    const double close = type.name == "quantisation" ? 0.5 * typical_parameters(type).front() + 1e-12 : 1e-12;
    for (double time : {0.0, 0.5, 3.0})
      for (double value : {-2.0, -0.3, 0.0, 0.04, 0.15, 0.45, 0.7}) {
        if (type.name == "stuck" && time >= typical_parameters(type).front()) {
          EXPECT_TRUE(std::isnan(effect->undo_signal(value, time)));
          continue;
        }
        const double back = effect->undo_signal(undone ? effect->signal(value, time) : value, time);
        const bool hidden = (type.name == "saturation" && std::abs(value) >= 0.5) ||
                            (type.name == "deadband" && std::abs(value) <= 0.1);
        if (hidden)
          EXPECT_TRUE(std::isnan(back)) << value;
        else
          EXPECT_NEAR(back, value, close);
      }
  });
  for (const char* name : {"offset", "scale", "drift", "gain_curve", "deadband", "saturation", "free_signal"})
    EXPECT_EQ(without_memory.count(name), 1u) << name;
}

// With memory: what went in is found from what came out around a time, alone and beside a model that is right, and the
// effect goes on from there as if it had run all along.
TEST(EffectContract, WhatASensorShowsIsUndoneWhateverItRemembers) {
  std::set<std::string> with_memory;
  for (const EffectType& type : effect_types()) {
    if (!type.fits_kind(PortKind::sensor) || type.name == "noise" || type.name == "quantisation") continue;
    SCOPED_TRACE(type.name);
    const auto effect = made(type, typical_parameters(type));
    if (!forgets(type)) {
      with_memory.insert(type.name);
      EXPECT_TRUE(effect->remembers());
    }
    const int count = 1150;  // before the probe's jumps
    std::vector<double> in, out;
    for (int k = 0; k <= count; ++k) {
      in.push_back(probe_signal(k * kProbeStep));
      out.push_back(effect->signal(in.back(), k * kProbeStep));
    }
    double most = 1e-9;
    for (int k = 0; k <= count; ++k)
      most = std::max(most, std::fabs(out[static_cast<std::size_t>(k)] - in[static_cast<std::size_t>(k)]));
    double alone = 0, beside = 0, gone_on = 0, by_values = 0;
    int found = 0;
    for (int k = 300; k < 650; k += 7) {
      const double time = k * kProbeStep;
      const Course course = [&](double later) {
        const double place = k + later / kProbeStep;
        const auto at = static_cast<std::size_t>(std::clamp(std::floor(place), 0.0, count - 1.0));
        const double slope = (out[at + 1] - out[at]) / kProbeStep;
        return Shown{out[at] + (place - static_cast<double>(at)) * kProbeStep * slope, slope, 1e-3};
      };
      const double went_in = in[static_cast<std::size_t>(k)];
      const auto other = made(type, typical_parameters(type));
      const Shown undone = other->undo(course, 0, time, kNoShape), again = other->undo(course, 0, time, went_in);
      if (std::isnan(undone.value)) continue;
      ++found;
      alone += std::fabs(undone.value - went_in);
      beside += std::fabs(again.value - went_in);
      const auto at = static_cast<std::size_t>(k);
      const auto plain = made(type, typical_parameters(type));
      plain->resume({in[at]}, {out[at]});
      for (std::size_t i = at + 1; i <= at + 40; ++i)
        by_values = std::max(by_values, std::fabs(plain->signal(in[i], static_cast<double>(i) * kProbeStep) - out[i]));
      other->resume(again, course(0));
      double late = 0;
      for (std::size_t i = static_cast<std::size_t>(k) + 1; i <= static_cast<std::size_t>(k) + 40; ++i)
        late = std::fabs(other->signal(in[i], static_cast<double>(i) * kProbeStep) - out[i]);
      gone_on += late;
    }
    ASSERT_GT(found, 20);
    // A signal held back by its rate was ahead by what nothing tells; in a play it lies anywhere, on average half of
    // that from either side.
    const double share = type.name == "rate_limit" ? 1 : type.name == "hysteresis" ? 0.5 : 0.05;
    EXPECT_LE(alone / found, share * most);
    EXPECT_LE(beside / found, 0.05 * most);
    EXPECT_LE(gone_on / found, 0.02 * most);
    if (with_memory.count(type.name) == 0) continue;
    EXPECT_EQ(effect->resumes_by_values(), by_values < 1e-9 * most) << by_values / most;
  }
  EXPECT_EQ(with_memory, (std::set<std::string>{"delay", "hysteresis", "lag", "rate_limit", "second_order_lag"}));
}

TEST(EffectContract, LeaksDissipateAndTwoWayLeaksAreOdd) {
  for (const EffectType& type : effect_types()) {
    if (type.family != "leakage") continue;
    SCOPED_TRACE(type.name);
    const auto effect = made(type, typical_parameters(type));
    for (double drop : {0.0, 1.0, 999.0, 1e5, 2e7})
      for (double speed : {-50.0, 0.0, 120.0}) {
        const double forward = effect->flow({drop, drop, speed});
        const double back = effect->flow({-drop, 0, speed});
        EXPECT_GE(forward, 0);
        EXPECT_GE(back * -drop, 0);
        const bool one_way = type.name == "relief_opening" || type.name == "overflow";
        EXPECT_EQ(back, one_way ? 0 : -forward);
      }
  }
}

TEST(EffectContract, FrictionTakesEnergyOut) {
  for (const EffectType& type : effect_types()) {
    if (type.family != "friction") continue;
    SCOPED_TRACE(type.name);
    const auto effect = made(type, typical_parameters(type));
    // Direction dependence only shifts a level that is there, so it gets one that is large enough.
    const double level = type.name == "asymmetric_friction" ? 15 : 0;
    if (type.name == "presliding_friction") continue;  // in closed cycles: bristles give back what wound them up
    for (double load : {-1e6, 0.0, 5e6})
      for (double velocity : {-0.4, -1e-3, 1e-3, 0.4}) {
        BodyForces f;
        f.sliding_plus = f.sliding_minus = f.breakaway_plus = f.breakaway_minus = level;
        effect->force({0.01, velocity, load}, f);
        EXPECT_GE(velocity * (f.viscous + (velocity > 0 ? f.sliding_plus : -f.sliding_minus)), 0);
        EXPECT_GE(f.breakaway_plus, f.sliding_plus);  // sticking holds at least what sliding does
        EXPECT_GE(f.breakaway_minus, f.sliding_minus);
        EXPECT_GE(f.breakaway_plus, 0);
        EXPECT_GE(f.breakaway_minus, 0);
        EXPECT_EQ(f.applied, 0);
        EXPECT_EQ(f.mass, 0);
      }
  }
}

TEST(EffectContract, ParametersOutsideTheirBoundsAreRefused) {
  for (const EffectType& type : effect_types()) {
    const std::string head = type.name + "@" + to_string(type.fits.front()) + ".probe:";
    const auto spec_text = [&](std::size_t changed, double value) {
      const auto typical = typical_parameters(type);
      std::string text = head;
      for (std::size_t i = 0; i < typical.size(); ++i)
        text += fmt::format("{}{}={}", i ? "," : "", type.parameters[i].name, i == changed ? value : typical[i]);
      return text;
    };
    for (std::size_t i = 0; i < type.parameters.size(); ++i) {
      const EffectParameter& p = type.parameters[i];
      SCOPED_TRACE(type.name + " " + p.name);
      EXPECT_NO_THROW(parse_effect(spec_text(i, p.minimum)));
      EXPECT_NO_THROW(parse_effect(spec_text(i, p.maximum)));
      EXPECT_THROW(parse_effect(spec_text(i, p.minimum - 1)), InputError);
      if (std::isfinite(p.maximum)) {
        EXPECT_THROW(parse_effect(spec_text(i, 2 * p.maximum + 1)), InputError);
      }
      EXPECT_THROW(parse_effect(spec_text(i, kNoShape)), InputError);
      try {
        parse_effect(spec_text(i, p.minimum - 1));
      } catch (const InputError& error) {
        EXPECT_NE(std::string(error.what()).find(p.name), std::string::npos);
        EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
      }
    }
    EXPECT_THROW(parse_effect(head + "no_such_parameter=1"), InputError) << type.name;
    EXPECT_THROW(parse_effect(head.substr(0, head.size() - 1)), InputError) << type.name;
  }
}

TEST(EffectContract, TextAndSpecAgree) {
  for (const EffectType& type : effect_types()) {
    const std::string text = type.name + "@" + to_string(type.fits.front()) + ".probe:" + typical_size(type.name);
    EXPECT_EQ(parse_effect(to_string(parse_effect(text))).parameters, parse_effect(text).parameters) << text;
  }
}

}  // namespace
}  // namespace faultline
