#pragma once

#include <memory>
#include <string>

#include "group_scenes.hpp"
#include "stepping.hpp"

namespace diracstep::group_scenes {

/// The error of a run of so many steps of GL(s) or another method up to T, in what is compared.
inline double error_at(const GroupScene& of, const Vector& reference, double T, int steps,
                       const std::string& method) {
  const Sample end = testing::samples_of(of.scene, {.method = method, .step = T / steps}, steps,
                                         Momentum::projected, Registry::with_built_ins(), steps)
                         .back();
  return (of.observe(end.q, end.v) - reference).lpNorm<Eigen::Infinity>();
}

inline std::shared_ptr<const Scene> free_body(const Eigen::Matrix3d& inertia, Vector omega,
                                              std::shared_ptr<const Space> on = rotations()) {
  return scene_of("free body", std::move(on),
                  lagrangian<4>([=]<class T>(const std::array<T, 4>&, const std::array<T, 4>& w) {
                    return quadratic<T>(inertia, {w[0], w[1], w[2]});
                  }),
                  generic_rotation(), std::move(omega));
}

}  // namespace diracstep::group_scenes
