#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/runs/rest_sizes.hpp>

namespace diracstep {

namespace {

/// Values of the second derivatives of L or H on their pattern.
struct SecondDerivatives {
  Vector qq, qy, yy;

  SecondDerivatives(const Scene& scene, const Sample& point) {
    const PhaseFunction& function = scene.stepped_function();
    for (Vector* block : {&qq, &qy, &yy}) block->setZero(function.pattern().nonzeros());
    function.hessian(point.time, point.q, scene.by_hamiltonian() ? point.p : point.v, qq, qy, yy);
  }
};

Vector cancelling_forces(const Scene& scene, const Sample& point, const SecondDerivatives& second) {
  const Eigen::Index n = scene.dimension();
  const Vector positions = scene.space ? Vector(Vector::Constant(n, max_norm(point.q))) : point.q.cwiseAbs(),
               velocities = point.v.cwiseAbs();
  Vector sum = Vector::Zero(n);
  const auto add = [&](const SparsityPattern& entries, const Vector& values, const Vector& sizes) {
    entries.multiply_add(values.cwiseAbs().eval().data(), sizes.data(), sum.data());
  };
  add(scene.stepped_function().pattern(), second.qq, positions);
  add(scene.stepped_function().pattern(), second.qy,
      scene.by_hamiltonian() ? Vector(point.p.cwiseAbs()) : velocities);
  if (!scene.force) return sum;
  Vector by_q(scene.force->pattern().nonzeros()), by_v(by_q.size());
  scene.force->derivatives(point.time, point.q, point.v, by_q, by_v);
  add(scene.force->pattern(), by_q, positions);
  add(scene.force->pattern(), by_v, velocities);
  return sum;
}

}  // namespace

Vector cancelling_forces(const Scene& scene, const Sample& point) {
  return cancelling_forces(scene, point, {scene, point});
}

RestSizes::RestSizes(const Scene& scene)
    : scene_(scene), force_(Vector::Zero(scene.dimension())), momentum_(force_), own_(force_) {}

void RestSizes::see(const Sample& point) {
  const double t = point.time;
  scene_.force_and_momentum(t, point.q, point.v, point.p, force_, momentum_);
  if (scene_.force) {
    scene_.force->value(t, point.q, point.v, own_);
    force_ = force_.cwiseAbs() + own_.cwiseAbs();
  }
  // Energies are squares: what cancels in the forces, which grows with the origin, is no part of them.
  const SecondDerivatives second(scene_, point);
  own_ = cancelling_forces(scene_, point, second);
  const bool by_momentum = scene_.by_hamiltonian();
  speed_ = energy_ = largest_force_ = 0.0;
  scene_.stepped_function().pattern().for_each([&](Eigen::Index k, int i, int j) {
    const double entry = std::abs(second.yy[k]), force = std::abs(force_[i]);
    const double terms = force + (std::isfinite(own_[i]) ? own_[i] : 0.0);
    const double per_mass = by_momentum ? entry : 1.0 / entry;
    if (i != j || !(entry > 0.0) || !std::isfinite(force * per_mass)) return;
    speed_ = std::max(speed_, terms * per_mass);
    largest_force_ = std::max(largest_force_, terms);
    energy_ += force * force * per_mass;
  });
}

}  // namespace diracstep
