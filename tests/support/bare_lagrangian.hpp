#pragma once

#include <diracstep/core/system/phase_function.hpp>
#include <diracstep/core/system/scene.hpp>
#include <memory>
#include <utility>

namespace diracstep::testing {

/// A Lagrangian without what comes beside it: a scene file's without its stage kernels.
class BareLagrangian final : public Lagrangian {
 public:
  explicit BareLagrangian(std::shared_ptr<const Lagrangian> of)
      : Lagrangian(of->pattern(), of->structure()), of_(std::move(of)) {}

  double value(double t, ConstVectorRef x, ConstVectorRef y) const override { return of_->value(t, x, y); }
  void gradient(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fx, VectorRef fy) const override {
    of_->gradient(t, x, y, fx, fy);
  }
  void hessian(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fxx, VectorRef fxy,
               VectorRef fyy) const override {
    of_->hessian(t, x, y, fxx, fxy, fyy);
  }
  void gradients(const PointColumns& at, double* fx, double* fy) const override {
    of_->gradients(at, fx, fy);
  }
  void hessians(const PointColumns& at, double* fxx, double* fxy, double* fyy) const override {
    of_->hessians(at, fxx, fxy, fyy);
  }
  void gradient_rate(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fyt) const override {
    of_->gradient_rate(t, x, y, fyt);
  }
  void position_gradient_rate(double t, ConstVectorRef x, ConstVectorRef y, VectorRef fxt) const override {
    of_->position_gradient_rate(t, x, y, fxt);
  }

 private:
  std::shared_ptr<const Lagrangian> of_;
};

inline std::shared_ptr<const Scene> without_stage_kernels(const Scene& scene) {
  auto bare = std::make_shared<Scene>(scene);
  bare->lagrangian = std::make_shared<const BareLagrangian>(scene.lagrangian);
  return bare;
}

}  // namespace diracstep::testing
