// What a missing signal may be a function of: variables along the rows of a stochastic model, and a small dictionary of
// terms made of them - powers, moduli, soft signs, lags and plays (memory), products of two.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace faultline {

struct SignalVariable {
  std::string name;
  std::string unit;
  int passes = -1;                      // position in passing() of the port's kind; -1: an effect there does not see it
  std::vector<Eigen::VectorXd> values;  // per stretch, one per row
  double scale = 1;                     // 95 % of |x| lie below
  double low = 0, high = 0;             // between which all but 0.4 % lie
  bool same(const SignalVariable& other) const;
};
// Fills what is missing with the value before, and sets scale and range. False: it says nothing.
bool settle_variable(SignalVariable& variable);

struct SignalTerm {
  std::string text;          // in SI units
  std::size_t variable = 0;  // the first; the number of variables for a constant
  double norm = 1;           // its root mean square: columns are divided by it
  // A term that is much like this one: beside a parameter that was refitted (a spring's rate) what is missing is the
  // difference of the two (x^3 - a x), of which neither alone shows anything. -1: none.
  int like = -1;
};

// Terms with their courses, simplest first.
class SignalTerms {
 public:
  SignalTerms(const std::vector<SignalVariable>& variables, double step);

  void add_singles();   // of each variable, and a constant
  void add_memories();  // lags and plays of each
  void add_products(const std::vector<std::size_t>& chosen);

  const std::vector<SignalTerm>& terms() const { return terms_; }
  std::vector<Eigen::MatrixXd> courses() const;  // per stretch: rows x terms

 private:
  using Make = std::function<Eigen::VectorXd(std::size_t stretch)>;
  void add(const std::string& text, std::size_t variable, const Make& make);
  void add_function(const std::string& text, std::size_t variable, const std::function<double(double)>& f);

  const std::vector<SignalVariable>& variables_;
  double step_;  // s, between rows
  std::vector<SignalTerm> terms_;
  std::vector<std::vector<Eigen::VectorXd>> columns_;  // per term and stretch
};

}  // namespace faultline
