#pragma once

#include <cstdlib>
#include <stdexcept>
#include <vector>

/// Stands for NLopt's header on aarch64, where its library is not at hand. A search in lanes never
/// asks for a solve by NLopt; one that does ends here, and its test fails.
namespace nlopt {

enum algorithm { LD_SLSQP };
enum result { MAXEVAL_REACHED = 5 };
class forced_stop : public std::runtime_error {
  using std::runtime_error::runtime_error;
};
class roundoff_limited : public std::runtime_error {
  using std::runtime_error::runtime_error;
};
using vfunc = double (*)(const std::vector<double>&, std::vector<double>&, void*);
using mfunc = void (*)(unsigned, double*, unsigned, const double*, double*, void*);

class opt {
 public:
  opt(algorithm, unsigned) { std::abort(); }
  void set_lower_bounds(const std::vector<double>&) {}
  void set_upper_bounds(const std::vector<double>&) {}
  void set_min_objective(vfunc, void*) {}
  void add_inequality_mconstraint(mfunc, void*, const std::vector<double>&) {}
  void set_ftol_rel(double) {}
  void set_xtol_rel(double) {}
  void set_maxeval(int) {}
  void force_stop() {}
  result optimize(std::vector<double>&, double&) { std::abort(); }
};

}  // namespace nlopt
