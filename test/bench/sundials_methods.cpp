#include "sundials_methods.h"

#ifdef FAULTLINE_SUNDIALS

#include <arkode/arkode_arkstep.h>
#include <arkode/arkode_erkstep.h>
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_klu.h>
#include <sunmatrix/sunmatrix_sparse.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <string>

namespace faultline {

const bool SundialsMethod::kAvailable = true;

struct SundialsMethod::Parts {
  Parts(Kind which, OdeSystem& of, const double* given, const std::vector<double>& scale, double sample_period,
        int setting)
      : kind(which), system(of), inputs(given), period(sample_period), steps(1 << setting) {
    const auto n = static_cast<sunindextype>(system.states());
    SUNContext_Create(nullptr, &context);
    y = N_VNew_Serial(n, context);
    tolerance = N_VNew_Serial(n, context);
    N_VConst(0, y);
    const double relative = kind == Kind::bdf ? std::pow(10.0, -2 - setting) : 1e-6;
    for (sunindextype i = 0; i < n; ++i) NV_Ith_S(tolerance, i) = relative * scale[static_cast<std::size_t>(i)];
    if (kind == Kind::explicit_runge_kutta) {
      memory = ERKStepCreate(rates, 0, y, context);
      ERKStepSetOrder(memory, 4);
      ERKStepSetUserData(memory, this);
      ERKStepSetFixedStep(memory, period / steps);
      ERKStepSStolerances(memory, 1e-6, 1e-6);
      return;
    }
    rate.resize(static_cast<std::size_t>(n));
    time_rate.resize(rate.size());
    entries.resize(system.jacobian_entries().size());
    std::map<std::pair<int, int>, sunindextype> places;  // (column, row)
    for (int i = 0; i < n; ++i) places[{i, i}] = 0;      // I - gamma J has them all
    for (const auto& [row, column] : system.jacobian_entries()) places[{column, row}] = 0;
    sunindextype next = 0;
    for (auto& [at, place] : places) place = next++;
    matrix = SUNSparseMatrix(n, n, next, CSC_MAT, context);
    for (const auto& [row, column] : system.jacobian_entries()) entry_places.push_back(places[{column, row}]);
    for (const auto& [at, place] : places) {
      rows.push_back(at.second);
      while (static_cast<int>(columns.size()) <= at.first) columns.push_back(place);
    }
    columns.push_back(next);
    solver = SUNLinSol_KLU(y, matrix, context);
    if (kind == Kind::bdf) {
      memory = CVodeCreate(CV_BDF, context);
      CVodeInit(memory, rates, 0, y);
      CVodeSetUserData(memory, this);
      CVodeSVtolerances(memory, relative, tolerance);
      CVodeSetLinearSolver(memory, solver, matrix);
      CVodeSetJacFn(memory, jacobian);
      CVodeSetMaxNumSteps(memory, 100000);
    } else {
      memory = ARKStepCreate(nullptr, rates, 0, y, context);
      ARKStepSetOrder(memory, 3);
      ARKStepSetUserData(memory, this);
      ARKStepSVtolerances(memory, relative, tolerance);
      ARKStepSetLinearSolver(memory, solver, matrix);
      ARKStepSetJacFn(memory, jacobian);
      ARKStepSetFixedStep(memory, period / steps);
    }
  }
  ~Parts() {
    if (kind == Kind::bdf) CVodeFree(&memory);
    if (kind == Kind::implicit_runge_kutta) ARKStepFree(&memory);
    if (kind == Kind::explicit_runge_kutta) ERKStepFree(&memory);
    if (solver) SUNLinSolFree(solver);
    if (matrix) SUNMatDestroy(matrix);
    N_VDestroy(tolerance);
    N_VDestroy(y);
    SUNContext_Free(&context);
  }

  static int rates(double time, N_Vector x, N_Vector rate, void* self) {
    const Parts& p = *static_cast<Parts*>(self);
    p.system.derivative(time, N_VGetArrayPointer(x), p.inputs, N_VGetArrayPointer(rate));
    return 0;
  }
  static int jacobian(double time, N_Vector x, N_Vector, SUNMatrix j, void* self, N_Vector, N_Vector, N_Vector) {
    Parts& p = *static_cast<Parts*>(self);
    p.system.jacobian(time, N_VGetArrayPointer(x), p.inputs, p.rate.data(), p.time_rate.data(), p.entries.data());
    std::copy(p.columns.begin(), p.columns.end(), SUNSparseMatrix_IndexPointers(j));
    std::copy(p.rows.begin(), p.rows.end(), SUNSparseMatrix_IndexValues(j));
    double* values = SUNSparseMatrix_Data(j);
    std::fill_n(values, p.rows.size(), 0.0);
    for (std::size_t i = 0; i < p.entries.size(); ++i) values[p.entry_places[i]] += p.entries[i];
    return 0;
  }

  static void check(int flag) {
    if (flag < 0) throw std::runtime_error("SUNDIALS returned " + std::to_string(flag));
  }

  Kind kind;
  OdeSystem& system;
  const double* inputs;
  double period;
  int steps;
  SUNContext context = nullptr;
  N_Vector y = nullptr, tolerance = nullptr;
  SUNMatrix matrix = nullptr;
  SUNLinearSolver solver = nullptr;
  void* memory = nullptr;
  std::vector<double> rate, time_rate, entries;
  std::vector<sunindextype> entry_places, rows, columns;
};

SundialsMethod::SundialsMethod(Kind kind, OdeSystem& system, const double* inputs, const std::vector<double>& scale,
                               double period, int setting)
    : parts_(std::make_unique<Parts>(kind, system, inputs, scale, period, setting)) {}
SundialsMethod::~SundialsMethod() = default;

double* SundialsMethod::state() { return N_VGetArrayPointer(parts_->y); }

void SundialsMethod::begin() {
  Parts& p = *parts_;
  if (p.kind == Kind::bdf) Parts::check(CVodeReInit(p.memory, 0, p.y));
  if (p.kind == Kind::implicit_runge_kutta) Parts::check(ARKStepReset(p.memory, 0, p.y));
  if (p.kind == Kind::explicit_runge_kutta) Parts::check(ERKStepReset(p.memory, 0, p.y));
}

void SundialsMethod::sample(double time) {
  Parts& p = *parts_;
  double reached = time;
  if (p.kind == Kind::bdf) {
    CVodeSetStopTime(p.memory, time + p.period);
    Parts::check(CVode(p.memory, time + p.period, p.y, &reached, CV_NORMAL));
    return;
  }
  for (int i = 1; i <= p.steps; ++i) {
    const double until = time + i * p.period / p.steps;
    if (p.kind == Kind::implicit_runge_kutta) {
      ARKStepSetStopTime(p.memory, until);
      Parts::check(ARKStepEvolve(p.memory, until, p.y, &reached, ARK_NORMAL));
      continue;
    }
    ERKStepSetStopTime(p.memory, until);
    Parts::check(ERKStepEvolve(p.memory, until, p.y, &reached, ARK_NORMAL));
    p.system.after_step(until, N_VGetArrayPointer(p.y), p.inputs);
    Parts::check(ERKStepReset(p.memory, until, p.y));
  }
}

}  // namespace faultline

#else

namespace faultline {

const bool SundialsMethod::kAvailable = false;

struct SundialsMethod::Parts {};
SundialsMethod::SundialsMethod(Kind, OdeSystem&, const double*, const std::vector<double>&, double, int) {}
SundialsMethod::~SundialsMethod() = default;
double* SundialsMethod::state() { return nullptr; }
void SundialsMethod::begin() {}
void SundialsMethod::sample(double) {}

}  // namespace faultline

#endif
