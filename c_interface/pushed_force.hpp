#pragma once

#include <diracstep/core/system/force.hpp>
#include <memory>

namespace diracstep::c_interface {

/// The force of a scene, if there is one, and a further one that its owner changes between steps.
class PushedForce final : public Force {
 public:
  PushedForce(std::shared_ptr<const Force> own, std::shared_ptr<const Vector> push)
      : Force(own ? own->pattern() : nothing(static_cast<int>(push->size()))),
        own_(std::move(own)),
        push_(std::move(push)) {}

  void value(double t, ConstVectorRef q, ConstVectorRef v, VectorRef f) const override {
    if (own_) {
      own_->value(t, q, v, f);
      f += *push_;
    } else {
      f = *push_;
    }
  }

  void derivatives(double t, ConstVectorRef q, ConstVectorRef v, VectorRef fq, VectorRef fv) const override {
    if (own_) own_->derivatives(t, q, v, fq, fv);
  }

 private:
  static SparsityPattern nothing(int n) { return {n, n, {}}; }

  std::shared_ptr<const Force> own_;
  std::shared_ptr<const Vector> push_;
};

}  // namespace diracstep::c_interface
