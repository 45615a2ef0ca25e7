#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/validation/references/odeint_steps.hpp>

#ifdef DIRACSTEP_WITH_ODEINT
#include <algorithm>
#include <array>
#include <boost/numeric/odeint/stepper/bulirsch_stoer.hpp>
#include <boost/numeric/odeint/stepper/controlled_runge_kutta.hpp>
#include <boost/numeric/odeint/stepper/generation.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <sstream>
#endif

namespace diracstep {

#ifdef DIRACSTEP_WITH_ODEINT

namespace {

namespace odeint = boost::numeric::odeint;

constexpr int most_rejections = 500;       // of one step
constexpr double part_of_the_size = 1e-2;  // that y may change by in the first step tried
constexpr double same_time = 1e-14;        // relative

template <std::size_t size>
class Integration {
  using Column = std::array<double, size>;

 public:
  Integration(SizedEquations& equations, double t_end, const ReferenceOptions& options, double& t,
              ReferenceRun& run)
      : equations_(equations), t_end_(t_end), options_(options), t_(t), run_(run) {}

  void go(ExplicitCode code, double* at) {
    Column y;
    std::copy_n(at, size, y.begin());
    const double atol = options_.atol > 0.0 ? options_.atol : options_.rtol;
    if (code == ExplicitCode::fehlberg78)
      take_steps(odeint::make_controlled<odeint::runge_kutta_fehlberg78<Column>>(atol, options_.rtol), y);
    else
      take_steps(odeint::bulirsch_stoer<Column>(atol, options_.rtol), y);
    std::copy_n(y.begin(), size, at);
  }

 private:
  template <class Stepper>
  void take_steps(Stepper stepper, Column& y) {
    const auto rate = [this](const Column& at, Column& to, double) {
      ++run_.residual_evaluations;
      if (!equations_.rate(at.data(), to.data())) to.fill(std::nan(""));
    };
    const double all = t_end_ - t_;
    double h = first_step(y, rate, all);
    for (int rejections = 0; t_end_ - t_ > same_time * all && run_.ok();) {
      if (run_.steps >= options_.max_steps) return fail("the step limit is reached");
      h = std::min(h, t_end_ - t_);
      if (stepper.try_step(rate, y, t_, h) == odeint::fail) {
        ++run_.error_test_failures;
        if (++rejections > most_rejections) return fail("no step passes its error test");
        continue;
      }
      rejections = 0;
      ++run_.steps;
      if (!all_finite(y.data(), size)) return fail("a value is not finite");
    }
  }

  template <class Rate>
  static double first_step(const Column& y, const Rate& rate, double all) {
    Column by_time;
    rate(y, by_time, 0.0);
    const double speed = largest_entry(by_time.data(), size), length = largest_entry(y.data(), size);
    return speed > 0.0 && length > 0.0 ? std::min(all, part_of_the_size * length / speed)
                                       : part_of_the_size * all;
  }

  void fail(const char* why) {
    std::ostringstream message;
    message << why << " at t = " << t_;
    run_.failure = message.str();
  }

  SizedEquations& equations_;
  double t_end_;
  const ReferenceOptions& options_;
  double& t_;
  ReferenceRun& run_;
};

}  // namespace

bool has_odeint() { return true; }

void integrate_by_odeint(SizedEquations& equations, ExplicitCode code, double t_end,
                         const ReferenceOptions& options, double* y, double& t, ReferenceRun& run) {
  switch (equations.size()) {
    case 2:
      return Integration<2>(equations, t_end, options, t, run).go(code, y);
    case 4:
      return Integration<4>(equations, t_end, options, t, run).go(code, y);
    case 6:
      return Integration<6>(equations, t_end, options, t, run).go(code, y);
    case 8:
      return Integration<8>(equations, t_end, options, t, run).go(code, y);
    default:
      throw Misuse("Boost.odeint is used for 1 to 4 coordinates");
  }
}

#else

bool has_odeint() { return false; }

void integrate_by_odeint(SizedEquations&, ExplicitCode, double, const ReferenceOptions&, double*, double&,
                         ReferenceRun&) {
  throw Misuse("this build is without Boost.odeint");
}

#endif

}  // namespace diracstep
