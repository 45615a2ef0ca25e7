#include <diracstep/core/integrator/point_reader.hpp>
#include <diracstep/core/integrator/solved_start.hpp>

namespace diracstep {

SolvedStart solved_start(const std::shared_ptr<const Scene>& given, const IntegratorOptions& options,
                         const SolverFactory& solvers) {
  constexpr int full_up_to = 200;  // unknowns for which full matrices are taken
  SolvedStart solved{prepared(given, options, solvers), {}, {}};
  const Scene& scene = *solved.prepared.scene;
  const Start& start = scene.start;
  PointReader reader(solved.prepared.scene, solvers, scene.dimension() + scene.rows() <= full_up_to);
  Vector force(scene.dimension()), p(scene.dimension());
  scene.force_and_momentum(start.time, start.q, start.v, start.p, force, p);
  Sample& sample = solved.sample;
  SolveReport report =
      reader.read(start.time, {.q = start.q, .p = p, .v = start.v}, Momentum::projected, sample);
  if (report.ok())
    report = reader.acceleration(start.time, start.q, sample.v, sample.p, solved.acceleration, sample.lambda);
  if (report.ok()) return solved;
  throw Error("scene '" + scene.name +
              "': velocities, accelerations and forces of rows at the start: " + describe(report.status));
}

}  // namespace diracstep
