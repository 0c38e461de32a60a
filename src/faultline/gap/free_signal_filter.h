// Likelihood of a stochastic model (stochastic_model.h), alone or with a free signal at one port, and what the readings
// say of both: Kalman filter and the backward pass of Rauch, Tung and Striebel.
//
//   u_i+1 = a u_i + noise,  a = exp(-step/memory),  u ~ N(0, level^2)     Ornstein-Uhlenbeck
//   minus log likelihood = 1/2 sum of (innovation^2/S + log S)
//
// Blocks (segments) count with a noise level of their own: 1/2 sum log S + n/2 log(mean innovation^2/S), so that one in
// which the model goes astray does not outweigh all others.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "faultline/gap/stochastic_model.h"

namespace faultline {

struct FreeSignal {
  int port = -1;      // position among the model's ports; -1: none
  double level = 0;   // standard deviation, in the port's unit
  double memory = 0;  // s
};

// Noise level of a block, 1/count of the sum of innovation^2/S, but no better than noise can be.
double block_variance(double square, double count);

// Loss of each block, stretches one after the other. `q`: variances of the process noise per step, in sizes squared.
std::vector<double> block_losses(const StochasticModel& model, const Eigen::VectorXd& q, const FreeSignal& signal);

// What the filter without a signal knows along a stretch.
struct FilteredStretch {
  std::vector<Eigen::VectorXd> predicted;  // per row: e before its readings
  std::vector<Eigen::MatrixXd> known;      // per row: covariance of e with them
  std::vector<double> square, count;       // per block: sum of innovation^2/S, and readings
};
std::vector<FilteredStretch> filter_stretches(const StochasticModel& model, const Eigen::VectorXd& q, int jobs);

struct Smoothing {
  std::vector<Eigen::MatrixXd> states;  // per stretch, e: states x rows
  std::vector<Eigen::VectorXd> signal;  // u, per row
  std::vector<Eigen::VectorXd> spread;  // its standard deviation
  Eigen::VectorXd known;                // per state: typical standard deviation after a row's readings
  Eigen::VectorXd q;                    // mean squared process noise of a typical block: one step of EM
  double level = 0;                     // likewise of the free signal
};
Smoothing smooth(const StochasticModel& model, const Eigen::VectorXd& q, const FreeSignal& signal, int jobs = 1);

// How well known courses of a signal at the port explain the readings beside the free one: sums over `parts` pieces of
// each stretch of A'A and A'r. r: innovations over their standard deviation, blocks with a noise level of their own;
// A: what of them one unit of each course is (generalised least squares by filter: de Jong, Annals of Statistics 19,
// 1991).
struct SignalEquations {
  std::size_t run = 0;
  Eigen::MatrixXd a;
  Eigen::VectorXd b;
};
std::vector<SignalEquations> signal_equations(const StochasticModel& model, const Eigen::VectorXd& q,
                                              const FreeSignal& signal, const std::vector<Eigen::MatrixXd>& courses,
                                              std::size_t parts);

}  // namespace faultline
