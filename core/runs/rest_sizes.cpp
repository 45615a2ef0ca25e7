#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/runs/rest_sizes.hpp>

namespace diracstep {

Vector cancelling_forces(const Scene& scene, const Sample& point) {
  const Eigen::Index n = scene.dimension();
  const SparsityPattern& pattern = scene.stepped_function().pattern();
  const Vector positions = scene.space ? Vector(Vector::Constant(n, max_norm(point.q))) : point.q.cwiseAbs(),
               velocities = point.v.cwiseAbs();
  const Vector& y = scene.by_hamiltonian() ? point.p : point.v;
  Vector sum = Vector::Zero(n), by_q(pattern.nonzeros()), by_y(by_q), mass(by_q);
  scene.stepped_function().hessian(point.time, point.q, y, by_q, by_y, mass);
  const auto add = [&](const SparsityPattern& entries, const Vector& values, const Vector& sizes) {
    entries.multiply_add(values.cwiseAbs().eval().data(), sizes.data(), sum.data());
  };
  add(pattern, by_q, positions);
  add(pattern, by_y, y.cwiseAbs());
  if (!scene.force) return sum;
  by_q.resize(scene.force->pattern().nonzeros());
  by_y.resize(by_q.size());
  scene.force->derivatives(point.time, point.q, point.v, by_q, by_y);
  add(scene.force->pattern(), by_q, positions);
  add(scene.force->pattern(), by_y, velocities);
  return sum;
}

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
  // Energies are squares: what cancels in the forces, which grows with the origin, is no part of them.
  own_ = cancelling_forces(scene_, point);
  const bool by_momentum = scene_.by_hamiltonian();
  const PhaseFunction& function = scene_.stepped_function();
  function.hessian(t, point.q, by_momentum ? point.p : point.v, qq_, qy_, yy_);
  speed_ = energy_ = largest_force_ = 0.0;
  function.pattern().for_each([&](Eigen::Index k, int i, int j) {
    const double entry = std::abs(yy_[k]), force = std::abs(force_[i]);
    const double terms = force + (std::isfinite(own_[i]) ? own_[i] : 0.0);
    const double per_mass = by_momentum ? entry : 1.0 / entry;
    if (i != j || !(entry > 0.0) || !std::isfinite(force * per_mass)) return;
    speed_ = std::max(speed_, terms * per_mass);
    largest_force_ = std::max(largest_force_, terms);
    energy_ += force * force * per_mass;
  });
}

}  // namespace diracstep
