// Our numerics beside what libraries do, on the equations of the rigs: what is not at least twice as fast as a library
// is replaced by it (docs/benchmarks.md). `allocations`: per pass, from the heap. `error`: largest difference of any
// state from a reference in fine steps, in parts of that state's largest value; a library's tolerance or step is the
// coarsest at which it is as accurate as ours.
#include <benchmark/benchmark.h>

#include <array>
#include <functional>
#include <map>

#include <Eigen/Dense>
#include <Eigen/SparseLU>
#include <boost/numeric/odeint/stepper/rosenbrock4.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_dopri5.hpp>

#include "allocations.h"
#include "faultline/estimators/observed_correction.h"
#include "faultline/estimators/row_correction.h"
#include "faultline/numerics/integrator.h"
#include "faultline/numerics/random.h"
#include "faultline/numerics/sparse_lu.h"
#include "faultline/numerics/triangle.h"
#include "rigs/cooling_circuit/runs.h"
#include "sundials_methods.h"

namespace faultline {
namespace {

template <class Pass>
void measure(benchmark::State& state, Pass&& pass) {
  pass();
  const std::uint64_t before = allocations();
  std::uint64_t passes = 0;
  for (auto _ : state) {
    pass();
    ++passes;
  }
  state.counters["allocations"] = static_cast<double>(allocations() - before) / static_cast<double>(passes);
}

// Columns of water with inertia in all six lines: seven states more than the rig has without.
std::vector<std::string> all_lines() {
  std::vector<std::string> texts;
  for (const std::string& text : cooling_effects())
    if (text.rfind("line_inertia@", 0) == 0) texts.push_back(text);
  return texts;
}

// ---- Sparse LU: the factorisation and four solutions of a Rosenbrock step, cooling circuit under load

struct Jacobian {
  explicit Jacobian(bool lines) : made(7e6, 0.8, 0.5, lines ? all_lines() : std::vector<std::string>()) {
    rig = made.rig.get();
    size = rig->states();
    entries = rig->jacobian_entries();
    values.resize(entries.size());
    std::vector<double> rate(made.state.size()), time_rate(rate);
    rig->jacobian(0, made.state.data(), made.channels.data(), rate.data(), time_rate.data(), values.data());
    right.assign(made.state.size(), 1.0);
    // d I - J by columns, as libraries want it: where the diagonal and where each entry goes.
    std::map<std::pair<int, int>, int> places;  // (column, row)
    for (int i = 0; i < size; ++i) places[{i, i}] = 0;
    for (const auto& [row, column] : entries) places[{column, row}] = 0;
    int next = 0;
    columns.assign(1, 0);
    for (auto& [at, place] : places) {
      while (static_cast<int>(columns.size()) <= at.first) columns.push_back(next);
      rows.push_back(at.second);
      place = next++;
    }
    columns.push_back(next);
    for (int i = 0; i < size; ++i) diagonal.push_back(places[{i, i}]);
    for (const auto& [row, column] : entries) entry.push_back(places[{column, row}]);
    matrix.assign(rows.size(), 0);
  }
  void fill() {
    std::fill(matrix.begin(), matrix.end(), 0);
    for (const int place : diagonal) matrix[static_cast<std::size_t>(place)] = kDiagonal;
    for (std::size_t i = 0; i < entry.size(); ++i) matrix[static_cast<std::size_t>(entry[i])] -= values[i];
  }

  static constexpr double kDiagonal = 2 / 0.25e-3;  // of a step of 0.25 ms
  CoolingRig made;
  Rig* rig;
  int size;
  std::vector<std::pair<int, int>> entries;
  std::vector<double> values, right, matrix;
  std::vector<int> columns, rows, diagonal, entry;
};

// `solve(x)` factors and solves for four right sides; their solutions must be right.
template <class Solve>
void sparse(benchmark::State& state, Jacobian& jacobian, Solve&& solve) {
  Eigen::MatrixXd dense = Jacobian::kDiagonal * Eigen::MatrixXd::Identity(jacobian.size, jacobian.size);
  for (std::size_t i = 0; i < jacobian.entries.size(); ++i)
    dense(jacobian.entries[i].first, jacobian.entries[i].second) -= jacobian.values[i];
  std::array<std::vector<double>, 4> x;
  x.fill(jacobian.right);
  solve(x);
  const Eigen::Map<const Eigen::VectorXd> right(jacobian.right.data(), jacobian.size);
  for (const auto& side : x)
    if (!(dense * Eigen::Map<const Eigen::VectorXd>(side.data(), jacobian.size)).isApprox(right, 1e-9))
      return state.SkipWithError("wrong answer");
  measure(state, [&] {
    for (auto& side : x) std::copy(jacobian.right.begin(), jacobian.right.end(), side.begin());
    solve(x);
    benchmark::DoNotOptimize(x[3][0]);
  });
}

void sparse_lu_ours(benchmark::State& state, bool lines) {
  Jacobian jacobian(lines);
  SparseLu lu(jacobian.size, jacobian.entries);
  sparse(state, jacobian, [&](auto& x) {
    lu.factor(Jacobian::kDiagonal, jacobian.values.data());
    for (auto& side : x) lu.solve(side.data());
  });
}

void sparse_lu_eigen(benchmark::State& state, bool lines) {
  Jacobian jacobian(lines);
  const Eigen::Map<const Eigen::SparseMatrix<double>> matrix(
      jacobian.size, jacobian.size, static_cast<Eigen::Index>(jacobian.rows.size()), jacobian.columns.data(),
      jacobian.rows.data(), jacobian.matrix.data());
  jacobian.fill();
  Eigen::SparseMatrix<double> owned = matrix;
  Eigen::SparseLU<Eigen::SparseMatrix<double>> lu;
  lu.analyzePattern(owned);
  sparse(state, jacobian, [&](auto& x) {
    jacobian.fill();
    std::copy(jacobian.matrix.begin(), jacobian.matrix.end(), owned.valuePtr());
    lu.factorize(owned);
    for (auto& side : x) {
      Eigen::Map<Eigen::VectorXd> map(side.data(), jacobian.size);
      map = lu.solve(map).eval();
    }
  });
}

void sparse_lu_dense(benchmark::State& state, bool lines) {
  using Dense = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 32, 32>;
  Jacobian jacobian(lines);
  Dense dense(jacobian.size, jacobian.size);
  Eigen::PartialPivLU<Dense> lu(jacobian.size);
  sparse(state, jacobian, [&](auto& x) {
    dense.setZero();
    dense.diagonal().setConstant(Jacobian::kDiagonal);
    for (std::size_t i = 0; i < jacobian.entries.size(); ++i)
      dense(jacobian.entries[i].first, jacobian.entries[i].second) -= jacobian.values[i];
    lu.compute(dense);
    for (auto& side : x) {
      Eigen::Map<Eigen::VectorXd> map(side.data(), jacobian.size);
      map = lu.solve(map).eval();
    }
  });
}

// ---- Integrators: samples of 1 ms with held inputs, as the simulator runs them, from rest into a change of load

constexpr double kPeriod = 1e-3;  // s
constexpr int kSamples = 400;
constexpr int kReferenceSteps = 64;  // per sample
constexpr int kOurSteps = 4;         // per sample: 0.25 ms

struct Problem {
  std::unique_ptr<EffectSet> effects;
  std::unique_ptr<Rig> rig;
  std::vector<double> channels, start;
  std::vector<std::vector<double>> reference;
  std::vector<double> scale;
  std::function<void(Problem&, int)> load;  // sets the inputs of a sample

  std::size_t states() const { return start.size(); }
  void make(const Datasheet& sheet, const std::vector<std::string>& texts) {
    std::vector<EffectSpec> specs;
    for (const std::string& text : sheet.nominal_effects) specs.push_back(parse_effect(text));
    for (const std::string& text : texts) specs.push_back(parse_effect(text));
    effects = std::make_unique<EffectSet>(sheet, specs, kPeriod / kOurSteps, 1);
    rig = find_rig_type(sheet.rig)->make(sheet, sheet.nominal(), *effects);
    channels.assign(sheet.channels.size(), 0);
    start.assign(static_cast<std::size_t>(rig->states()), 0);
  }
  void reset() {
    load(*this, -1);
    rig->set_modes(start.data());
  }
  void refer() {
    load(*this, -1);
    rig->start(channels.data(), start.data());
    const auto method = make_integrator(*rig);
    std::copy(start.begin(), start.end(), method->state());
    scale.assign(states(), 1e-12);
    for (int k = 0; k < kSamples; ++k) {
      load(*this, k);
      for (int i = 0; i < kReferenceSteps; ++i)
        method->step(k * kPeriod + i * kPeriod / kReferenceSteps, kPeriod / kReferenceSteps, channels.data());
      reference.emplace_back(method->state(), method->state() + states());
      for (std::size_t s = 0; s < states(); ++s) scale[s] = std::max(scale[s], std::abs(reference.back()[s]));
    }
  }
};

Problem cooling_problem(bool lines) {
  Problem problem;
  problem.make(cooling(), lines ? all_lines() : std::vector<std::string>());
  const std::size_t supply = cooling_column("supply_pressure"), valve = cooling_column("bench_valve_command"),
                    heat = cooling_column("heat_load_command");
  problem.load = [=](Problem& p, int k) {
    p.channels[supply] = 7e6 + (k < 0 ? 0 : 1e5 * std::sin(0.05 * k));
    p.channels[valve] = k < 0 ? 0.5 : 0.9;
    p.channels[heat] = k < 0 ? 0 : 1;
  };
  problem.refer();
  return problem;
}

Problem servo_problem(bool effects) {
  Problem problem;
  problem.make(servo(), effects ? std::vector<std::string>{"line_inertia@line.valve_cylinder:inertance=1e6",
                                                           "elasticity@transmission.rod:compliance=1e-7,damping=1e3",
                                                           "entrained_air@compliance.chambers:fraction=0.01",
                                                           "orifice_leakage@flow.chamber_a_chamber_b:coefficient=1e-8"}
                                : std::vector<std::string>());
  const std::size_t supply = column("supply_pressure"), valve = column("valve_command");
  problem.load = [=](Problem& p, int k) {
    p.channels[supply] = 1e7;
    p.channels[valve] = k < 0 ? 0 : 2 * std::sin(0.03 * k);
  };
  problem.refer();
  return problem;
}

// One way to integrate a problem, at one of the settings it is tried with, from the coarsest on.
struct Method {
  std::function<double*()> state;
  std::function<void()> begin;         // the state was put to the problem's start
  std::function<void(double)> sample;  // one sample period from a time on
};
using MakeMethod = std::function<Method(Problem&, int setting)>;

double error_of(Problem& problem, Method& method) {
  problem.reset();
  std::copy(problem.start.begin(), problem.start.end(), method.state());
  method.begin();
  double worst = 0;
  for (int k = 0; k < kSamples; ++k) {
    problem.load(problem, k);
    method.sample(k * kPeriod);
    for (std::size_t s = 0; s < problem.states(); ++s) {
      const double off =
          std::abs(method.state()[s] - problem.reference[static_cast<std::size_t>(k)][s]) / problem.scale[s];
      worst = off <= worst ? worst : off;  // NaN stays
    }
  }
  return worst;
}

MakeMethod ours() {
  return [](Problem& problem, int) {
    std::shared_ptr<Integrator> integrator = make_integrator(*problem.rig);
    return Method{[=] { return integrator->state(); }, [] {},
                  [=, &problem](double time) {
                    for (int i = 0; i < kOurSteps; ++i)
                      integrator->step(time + i * kPeriod / kOurSteps, kPeriod / kOurSteps, problem.channels.data());
                  }};
  };
}

void integrate(benchmark::State& state, Problem problem, const MakeMethod& make, int settings) {
  Method method = ours()(problem, 0);
  const double wanted = error_of(problem, method);
  double error = 0;
  for (int setting = 0; setting < settings; ++setting) {
    method = make(problem, setting);
    error = error_of(problem, method);
    if (error <= 1.05 * wanted) break;
  }
  int k = kSamples;
  measure(state, [&] {
    if (k == kSamples) {
      k = 0;
      problem.reset();
      std::copy(problem.start.begin(), problem.start.end(), method.state());
      method.begin();
    }
    problem.load(problem, k);
    method.sample(k * kPeriod);
    ++k;
  });
  state.counters["error"] = error;
}

// Boost.odeint's stepper on vectors in 1, 2, 4, ... steps per sample.
template <class Stepper>
MakeMethod explicit_odeint() {
  return [](Problem& problem, int setting) {
    struct Run {
      std::vector<double> x;
      Stepper stepper;
    };
    auto run = std::make_shared<Run>();
    run->x = problem.start;
    const int steps = 1 << setting;
    return Method{[=] { return run->x.data(); }, [] {},
                  [=, &problem](double time) {
                    const double dt = kPeriod / steps;
                    for (int i = 0; i < steps; ++i) {
                      const double t = time + i * dt;
                      run->stepper.do_step(
                          [&](const std::vector<double>& x, std::vector<double>& rate, double at) {
                            problem.rig->derivative(at, x.data(), problem.channels.data(), rate.data());
                          },
                          run->x, t, dt);
                      problem.rig->after_step(t + dt, run->x.data(), problem.channels.data());
                    }
                  }};
  };
}

MakeMethod odeint_rosenbrock() {
  return [](Problem& problem, int setting) {
    using Stepper = boost::numeric::odeint::rosenbrock4<double>;
    struct Run {
      Stepper::state_type x;
      std::vector<double> rate, entries;
      Stepper stepper;
    };
    auto run = std::make_shared<Run>();
    run->x.resize(problem.states());
    run->rate.resize(problem.states());
    run->entries.resize(problem.rig->jacobian_entries().size());
    const int steps = 1 << setting;
    return Method{[=] { return &run->x[0]; }, [] {},
                  [=, &problem](double time) {
                    const double dt = kPeriod / steps;
                    const auto rates = [&](const Stepper::state_type& x, Stepper::state_type& rate, double at) {
                      problem.rig->derivative(at, &x[0], problem.channels.data(), &rate[0]);
                    };
                    const auto jacobian = [&](const Stepper::state_type& x, Stepper::matrix_type& j, double at,
                                              Stepper::state_type& time_rate) {
                      problem.rig->jacobian(at, &x[0], problem.channels.data(), run->rate.data(), &time_rate[0],
                                            run->entries.data());
                      j.clear();
                      std::size_t next = 0;
                      for (const auto& [row, column] : problem.rig->jacobian_entries())
                        j(static_cast<std::size_t>(row), static_cast<std::size_t>(column)) += run->entries[next++];
                    };
                    for (int i = 0; i < steps; ++i) {
                      run->stepper.do_step(std::make_pair(rates, jacobian), run->x, time + i * dt, dt);
                      problem.rig->after_step(time + (i + 1) * dt, &run->x[0], problem.channels.data());
                    }
                  }};
  };
}

MakeMethod sundials(SundialsMethod::Kind kind) {
  return [kind](Problem& problem, int setting) {
    auto method =
        std::make_shared<SundialsMethod>(kind, *problem.rig, problem.channels.data(), problem.scale, kPeriod, setting);
    return Method{[=] { return method->state(); }, [=] { method->begin(); },
                  [=](double time) { method->sample(time); }};
  };
}

// ---- Small linear algebra of the filters

template <class Matrix>
Matrix filled(Eigen::Index rows, Eigen::Index columns) {
  Matrix m(rows, columns);
  Random random(3);
  for (Eigen::Index i = 0; i < rows; ++i)
    for (Eigen::Index j = 0; j < columns; ++j) m(i, j) = random.normal();
  return m;
}

// The servo actuator's filter: fixed size. The cooling circuit's extended filter of five branches: free size below a
// maximum.
using ServoWide = Eigen::Matrix<double, 6, 18, Eigen::RowMajor>;
using ServoRoot = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
using CoolingWide = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor, 16, 65>;
using CoolingRoot = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor, 16, 16>;

enum class Triangle { ours, householder, cholesky };

template <class Wide, class Root>
void triangle(benchmark::State& state, Eigen::Index rows, Eigen::Index columns, Triangle how) {
  const Wide given = filled<Wide>(rows, columns);
  Wide m = given;
  Root root = m.leftCols(rows);
  // Rows along memory are columns of the transposed matrix.
  using Tall = Eigen::Matrix<double, Wide::ColsAtCompileTime, Wide::RowsAtCompileTime, Eigen::ColMajor,
                             Wide::MaxColsAtCompileTime, Wide::MaxRowsAtCompileTime>;
  using Square = Eigen::Matrix<double, Wide::RowsAtCompileTime, Wide::RowsAtCompileTime, Eigen::ColMajor,
                               Wide::MaxRowsAtCompileTime, Wide::MaxRowsAtCompileTime>;
  Eigen::HouseholderQR<Tall> qr(columns, rows);
  Eigen::LLT<Square> llt(rows);
  Square square(rows, rows);
  const auto pass = [&] {
    m = given;
    if (how == Triangle::ours) {
      reduce_to_triangle(m);
      root = m.leftCols(rows);
    } else if (how == Triangle::householder) {
      qr.compute(Eigen::Map<Tall>(m.data(), columns, rows));  // in place, by a Ref, it is slower
      root.setZero();
      root.template triangularView<Eigen::Lower>() = qr.matrixQR().topRows(rows).transpose();
    } else {
      square.setZero();
      square.template selfadjointView<Eigen::Lower>().rankUpdate(m);
      llt.compute(square);
      root = llt.matrixL();
    }
    benchmark::DoNotOptimize(root(0, 0));
  };
  pass();
  const Eigen::MatrixXd expected = given * given.transpose(), found = root * root.transpose();
  if (!found.isApprox(expected, 1e-10)) return state.SkipWithError("wrong answer");
  measure(state, pass);
}

void observed(benchmark::State& state, bool library) {
  ServoRoot root0 = filled<ServoRoot>(6, 6);
  root0.diagonal().array() += 4;
  root0.triangularView<Eigen::StrictlyUpper>().setZero();
  using Vector = Eigen::Matrix<double, 6, 1>;
  const Vector x0 = Vector::Ones();
  ServoRoot root = root0;
  Vector x = x0;
  if (!library) {
    measure(state, [&] {
      root = root0;
      x = x0;
      for (Eigen::Index k = 0; k < 4; ++k) correct_observed_state(x, root, k, 1.5, 0.3);
      benchmark::DoNotOptimize(root(0, 0));
    });
    return;
  }
  using Square = Eigen::Matrix<double, 6, 6>;
  const Eigen::LLT<Square> llt0(Square(root0 * root0.transpose()));
  Eigen::LLT<Square> llt = llt0;
  measure(state, [&] {
    llt = llt0;
    x = x0;
    for (Eigen::Index k = 0; k < 4; ++k) {
      const Vector column =
          llt.matrixL() *
          llt.matrixLLT().row(k).head(6).transpose().cwiseProduct(
              (Vector::LinSpaced(0, 5).array() <= static_cast<double>(k)).select(Vector::Ones(), Vector::Zero()));
      const double s = column[k] + 0.3;
      x += (1.5 - x[k]) / s * column;
      llt.rankUpdate(column / std::sqrt(s), -1);
    }
    benchmark::DoNotOptimize(llt.matrixLLT()(0, 0));
  });
}

void rows(benchmark::State& state, bool library) {
  constexpr Eigen::Index n = 10, m = 5;
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 16, 1>;
  using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 16, 16>;
  CoolingRoot root0 = filled<CoolingRoot>(n, n);
  root0.diagonal().array() += 4;
  root0.triangularView<Eigen::StrictlyUpper>().setZero();
  const CoolingRoot h = filled<CoolingRoot>(m, n);
  const Vector x0 = Vector::Ones(n);
  CoolingRoot root = root0;
  Vector x = x0;
  if (!library) {
    measure(state, [&] {
      root = root0;
      x = x0;
      for (Eigen::Index k = 0; k < m; ++k) correct_row(x, root, h.row(k).transpose(), 0.5, 0.3);
      benchmark::DoNotOptimize(root(0, 0));
    });
    return;
  }
  const Eigen::LLT<Square> llt0(Square(root0 * root0.transpose()));
  Eigen::LLT<Square> llt = llt0;
  Vector v(n), column(n);
  measure(state, [&] {
    llt = llt0;
    x = x0;
    for (Eigen::Index k = 0; k < m; ++k) {
      v.noalias() = llt.matrixU() * h.row(k).transpose();
      column.noalias() = llt.matrixL() * v;
      const double s = v.squaredNorm() + 0.3;
      x += 0.5 / s * column;
      column /= std::sqrt(s);
      llt.rankUpdate(column, -1);
    }
    benchmark::DoNotOptimize(llt.matrixLLT()(0, 0));
  });
}

// ---- Names: what/case/who

void add(const std::string& name, const std::function<void(benchmark::State&)>& run) {
  benchmark::RegisterBenchmark(name.c_str(), [run](benchmark::State& state) { run(state); });
}

const bool added = [] {
  for (const bool lines : {false, true}) {
    const std::string which = lines ? "lines/" : "nominal/";
    add("sparse_lu/" + which + "ours", [=](auto& s) { sparse_lu_ours(s, lines); });
    add("sparse_lu/" + which + "eigen_sparse_lu", [=](auto& s) { sparse_lu_eigen(s, lines); });
    add("sparse_lu/" + which + "eigen_dense_lu", [=](auto& s) { sparse_lu_dense(s, lines); });
    const auto stiff = [=](const std::string& who, const MakeMethod& make, int settings) {
      add("stiff/" + which + who, [=](auto& s) { integrate(s, cooling_problem(lines), make, settings); });
    };
    stiff("ours", ours(), 1);
    stiff("odeint_rosenbrock4", odeint_rosenbrock(), 7);
    if (SundialsMethod::kAvailable) {
      stiff("sundials_arkode_dirk", sundials(SundialsMethod::Kind::implicit_runge_kutta), 7);
      stiff("sundials_cvode_bdf", sundials(SundialsMethod::Kind::bdf), 10);
    }
  }
  for (const bool effects : {false, true}) {
    const auto explicitly = [=](const std::string& who, const MakeMethod& make, int settings) {
      add(std::string("explicit/") + (effects ? "effects/" : "nominal/") + who,
          [=](auto& s) { integrate(s, servo_problem(effects), make, settings); });
    };
    namespace odeint = boost::numeric::odeint;
    explicitly("ours", ours(), 1);
    explicitly("odeint_dopri5", explicit_odeint<odeint::runge_kutta_dopri5<std::vector<double>>>(), 7);
    if (SundialsMethod::kAvailable)
      explicitly("sundials_arkode_erk", sundials(SundialsMethod::Kind::explicit_runge_kutta), 7);
  }
  for (const auto& [who, how] : std::map<std::string, Triangle>{{"ours", Triangle::ours},
                                                                {"eigen_householder_qr", Triangle::householder},
                                                                {"eigen_llt", Triangle::cholesky}}) {
    add("triangle/6x18/" + who, [how = how](auto& s) { triangle<ServoWide, ServoRoot>(s, 6, 18, how); });
    add("triangle/10x30/" + who, [how = how](auto& s) { triangle<CoolingWide, CoolingRoot>(s, 10, 30, how); });
  }
  add("correction/states/ours", [](auto& s) { observed(s, false); });
  add("correction/states/eigen_llt_rank_update", [](auto& s) { observed(s, true); });
  add("correction/rows/ours", [](auto& s) { rows(s, false); });
  add("correction/rows/eigen_llt_rank_update", [](auto& s) { rows(s, true); });
  return true;
}();

}  // namespace
}  // namespace faultline
