#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <memory>

/// libFuzzer's entry: any numbers are a snapshot from which steps can be tried, or are refused with a
/// message, and then the integrator is as after reset().  The first byte chooses the integrator; then follow
/// changes to a right snapshot (where, and a number), or with an odd second byte its bytes themselves.
namespace {

using namespace diracstep;

std::unique_ptr<Integrator> integrator(std::uint8_t choice) {
  struct Kind {
    const char* scene;
    IntegratorOptions options;
  };
  static const Kind kinds[] = {{"knife_edge", {.method = "type1/midpoint", .step = 0.1}},
                               {"pendulum_cartesian", {.method = "type1/gl:2", .step = 0.05}},
                               {"kepler_e06", {.method = "type1/trapezoidal", .order = 4, .step = 0.05}},
                               {"lotka_volterra_2d", {.method = "type1/gl:2", .step = 0.05}}};
  const Kind& kind = kinds[choice % 4];
  auto made = std::make_unique<Integrator>(make_scene(kind.scene).scene, Registry::with_built_ins(), kinsol(),
                                           kind.options);
  for (int k = 0; k < 3; ++k)
    if (!made->step().ok()) std::abort();
  return made;
}

/// One of each kind, after three steps, and what it saved there: made once.
struct Prepared {
  std::unique_ptr<Integrator> integrator;
  Snapshot saved;
};
Prepared& prepared(std::uint8_t choice) {
  static Prepared all[4];
  Prepared& one = all[choice % 4];
  if (!one.integrator) {
    one.integrator = integrator(choice);
    one.saved = one.integrator->save();
  }
  return one;
}

Snapshot changed(Snapshot snapshot, const std::uint8_t* data, std::size_t size) {
  std::vector<double>& all = snapshot.numbers();
  for (; size >= 1 + sizeof(double); data += 1 + sizeof(double), size -= 1 + sizeof(double)) {
    double number = 0.0;
    std::memcpy(&number, data + 1, sizeof number);
    all[data[0] % all.size()] = number;
  }
  return snapshot;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  auto& [integrator, saved] = prepared(data[0]);
  try {
    const bool bytes = data[1] % 2 != 0;
    integrator->restore(bytes ? Snapshot::from_bytes({reinterpret_cast<const char*>(data + 2), size - 2})
                              : changed(saved, data + 2, size - 2));
    for (int k = 0; k < 2; ++k)
      if (!integrator->step().ok()) break;
  } catch (const Misuse& refused) {
    if (*refused.what() == '\0') std::abort();
    // Bytes that are no snapshot never reach the integrator.
    if (integrator->work().steps != 0 && integrator->save().bytes() != saved.bytes()) std::abort();
  }
  integrator->restore(saved);
  if (integrator->save().bytes() != saved.bytes()) std::abort();
  return 0;
}
