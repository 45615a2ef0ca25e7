#include <algorithm>
#include <cmath>
#include <diracstep/core/runs/rest_sizes.hpp>

namespace diracstep {

RestSizes::RestSizes(const Scene& scene)
    : scene_(scene), force_(Vector::Zero(scene.dimension())), momentum_(force_), own_(force_) {
  for (Vector* block : {&qq_, &qv_, &vv_}) block->setZero(scene.lagrangian->pattern().nonzeros());
}

void RestSizes::see(double t, const Vector& q, const Vector& v) {
  scene_.lagrangian->gradient(t, q, v, force_, momentum_);
  if (scene_.force) {
    scene_.force->value(t, q, v, own_);
    force_ = force_.cwiseAbs() + own_.cwiseAbs();
  }
  scene_.lagrangian->hessian(t, q, v, qq_, qv_, vv_);
  speed_ = energy_ = 0.0;
  scene_.lagrangian->pattern().for_each([&](Eigen::Index k, int i, int j) {
    const double mass = std::abs(vv_[k]), force = std::abs(force_[i]);
    if (i != j || !(mass > 0.0) || !std::isfinite(force / mass)) return;
    speed_ = std::max(speed_, force / mass);
    energy_ += force * force / mass;
  });
}

}  // namespace diracstep
