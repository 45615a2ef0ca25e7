#include <algorithm>
#include <cstddef>
#include <diracstep/core/equilibrium/small_motions.hpp>

namespace diracstep {

namespace {

/// A kink of the formulas at the point, across which derivatives jump; empty where there is none.
std::string kink_there(const Scene& scene, const Equilibrium& at) {
  constexpr double beside = 1e-7;  // of the largest coordinate or velocity
  if (!scene.kinks || scene.kinks->count() == 0 || scene.space) return {};
  Vector here(scene.kinks->count()), before = here, behind = here;
  scene.kinks->evaluate(at.time, at.q, at.v, here);
  const double largest = std::max(at.q.lpNorm<Eigen::Infinity>(), scene.start.q.lpNorm<Eigen::Infinity>());
  const double step = beside * (largest > 0.0 ? largest : 1.0);
  for (const bool moves : {false, true})
    for (Eigen::Index i = 0; i < at.q.size(); ++i) {
      Vector q = at.q, v = at.v;
      double& moved = moves ? v[i] : q[i];
      const double value = moved;
      moved = value - step;
      scene.kinks->evaluate(at.time, q, v, before);
      moved = value + step;
      scene.kinks->evaluate(at.time, q, v, behind);
      for (Eigen::Index k = 0; k < here.size(); ++k)
        if (const auto number = static_cast<std::size_t>(k);
            scene.kinks->kinds()[number] == Kinks::Kind::kink && before[k] * behind[k] < 0.0)
          return "the formulas have a kink there (" + scene.kinks->names()[number] +
                 "): derivatives differ on its two sides, and eigenvalues by one of them tell nothing of the "
                 "motion";
    }
  return {};
}

std::string doubt_of(const Scene& scene, const Equilibrium& at, double later, const SmallMotions& found) {
  constexpr double steady = 1e-7;  // relative change of the linear equations along a motion
  if (found.nearest && !found.nearest->failure.empty()) return found.nearest->failure;
  if (found.variation <= steady) return kink_there(scene, at);
  const bool moves = at.v.size() > 0 && at.v.cwiseAbs().maxCoeff() > 0.0;
  return "the linear equations change by " + to_text(found.variation, 2) + " of their size " +
         (moves ? "along the motion" : "with the time") + " until t = " + to_text(later) +
         ": the eigenvalues hold at t = " + to_text(at.time) + " only";
}

}  // namespace

SmallMotions small_motions(const Scene& scene, const Equilibrium& at, double later,
                           const SmallMotionOptions& options, const LargestEigenpairs& eigenpairs) {
  constexpr int usual_count = 10;
  SmallMotions found;
  if (options.modes || options.near || needs_sparse_matrices(scene)) {
    found.nearest =
        nearest_modes(scene, at, options.modes.value_or(usual_count), options.near, later, eigenpairs);
    found.modes = found.nearest->found;
    found.variation = found.nearest->variation;
  } else {
    found.linear = linearise(scene, at, later);
    found.modes = eigenmodes(*found.linear);
    found.variation = found.linear->variation;
  }
  found.doubt = doubt_of(scene, at, later, found);
  return found;
}

}  // namespace diracstep
