#include <algorithm>
#include <cmath>
#include <diracstep/core/runs/rest_sizes.hpp>

namespace diracstep {

RestSizes::RestSizes(const Scene& scene)
    : scene_(scene), force_(Vector::Zero(scene.dimension())), momentum_(force_), own_(force_) {
  for (Vector* block : {&qq_, &qy_, &yy_}) block->setZero(scene.stepped_function().pattern().nonzeros());
}

void RestSizes::see(const Sample& point) {
  const double t = point.time;
  scene_.force_and_momentum(t, point.q, point.v, point.p, force_, momentum_);
  if (scene_.force) {
    scene_.force->value(t, point.q, point.v, own_);
    force_ = force_.cwiseAbs() + own_.cwiseAbs();
  }
  const bool by_momentum = scene_.by_hamiltonian();
  const PhaseFunction& function = scene_.stepped_function();
  function.hessian(t, point.q, by_momentum ? point.p : point.v, qq_, qy_, yy_);
  speed_ = energy_ = largest_force_ = 0.0;
  function.pattern().for_each([&](Eigen::Index k, int i, int j) {
    const double entry = std::abs(yy_[k]), force = std::abs(force_[i]);
    const double per_mass = by_momentum ? entry : 1.0 / entry;
    if (i != j || !(entry > 0.0) || !std::isfinite(force * per_mass)) return;
    speed_ = std::max(speed_, force * per_mass);
    largest_force_ = std::max(largest_force_, force);
    energy_ += force * force * per_mass;
  });
}

}  // namespace diracstep
