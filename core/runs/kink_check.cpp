#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/runs/kink_check.hpp>
#include <sstream>

namespace diracstep {

namespace {

constexpr double part_of_jump = 0.1;  // of h J, that the momentum of a step over a jump is off by
constexpr double too_much = 0.01;     // of the largest momentum

}  // namespace

KinkCheck::KinkCheck(const Integrator& integrator)
    : scene_(integrator.scene()), kinks_(scene_.kinks && scene_.kinks->count() > 0 ? scene_.kinks : nullptr) {
  if (!kinks_) return;
  switches_.setZero(kinks_->count());
  for (Vector* column : {&force_, &momentum_, &own_}) column->setZero(scene_.dimension());
  read(integrator);
}

void KinkCheck::read(const Integrator& integrator) {
  const double t = integrator.time();
  const Vector &q = integrator.position(), &v = integrator.velocity_estimate();
  kinks_->evaluate(t, q, v, switches_);
  scene_.lagrangian->gradient(t, q, v, force_, momentum_);
  if (!scene_.force) return;
  scene_.force->value(t, q, v, own_);
  force_ += own_;
}

int KinkCheck::crossed() const {
  for (int k = 0; k < kinks_->count(); ++k)
    if (kinks_->kinds()[static_cast<std::size_t>(k)] == Kinks::Kind::kink &&
        switches_[k] * switches_before_[k] < 0.0)
      return k;
  return -1;
}

void KinkCheck::look(const Integrator& integrator) {
  switches_before_ = switches_;
  force_before_ = force_;
  read(integrator);
  largest_momentum_ = std::max(largest_momentum_, max_norm(integrator.momentum()));
  const double change = max_norm(force_ - force_before_);
  const double jump = change - 2.0 * change_;
  const int kink = crossed();
  if (kink < 0) {
    change_ = change;
    return;
  }
  if (integrator.met_kinks()) {  // where the step was divided
    change_ = 0.0;
    return;
  }
  if (!(jump > 0.0)) return;
  sum_ += part_of_jump * std::abs(integrator.options().step) * jump;
  if (++jumps_ > 1) return;
  first_ = kink;
  first_time_ = integrator.time();
}

std::string KinkCheck::text() const {
  if (!(sum_ > too_much * largest_momentum_)) return {};
  std::ostringstream text;
  text.precision(4);
  text << "forces jump where the motion crosses kinks of the formulas, " << jumps_
       << " times, first before t = " << first_time_ << " ("
       << kinks_->names()[static_cast<std::size_t>(first_)]
       << "): steps over them are of order 1 only; ask for an error, --error, which divides the motion there";
  return text.str();
}

}  // namespace diracstep
