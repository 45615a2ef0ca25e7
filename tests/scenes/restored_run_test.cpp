#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <optional>
#include <random>

/// A snapshot is all that an integrator goes by.  Every scene is stepped with every method and ways to solve
/// drawn at random, by steps of changing size, retries, and momenta read in between, so large that steps are
/// retried and fail.  Before each of these calls a second integrator, which has just been elsewhere, is given
/// a snapshot; after the call both must have the same one.
namespace diracstep {
namespace {

using Random = std::mt19937;

constexpr int max_coordinates = 20;
constexpr int calls = 14, ways_to_solve = 2;

template <class T, std::size_t N>
T one_of(const T (&choices)[N], Random& random) {
  return choices[random() % N];
}

/// How many numbers of two snapshots differ in a bit; many where their fields do.
long differences(const Snapshot& a, const Snapshot& b) {
  if (a.fields() != b.fields()) return std::ssize(a.numbers()) + std::ssize(b.numbers());
  const auto bits = [](double number) { return std::bit_cast<std::uint64_t>(number); };
  long count = 0;
  for (std::size_t i = 0; i < a.numbers().size(); ++i)
    count += bits(a.numbers()[i]) != bits(b.numbers()[i]) ? 1 : 0;
  return count;
}

struct Call {
  enum Kind { step, other_step, retry, minus } kind;
  double h;

  static Call drawn(double h, Random& random) {
    static constexpr Kind kinds[] = {step, step, step, step, other_step, retry, minus};
    static constexpr double factors[] = {0.3, 0.9, 1.1, 2.0};
    return {one_of(kinds, random), h * one_of(factors, random)};
  }

  bool operator()(Integrator& integrator) const {
    Sample sample;
    switch (kind) {
      case step:
        return integrator.step().ok();
      case other_step:
        return integrator.step(h).ok();
      case retry:
        return integrator.retry(h).ok();
      default:
        return integrator.sample(Momentum::minus, sample).ok();
    }
  }
};

struct Way {
  IntegratorOptions options;
  KinsolOptions solver;

  static Way drawn(const std::string& method, double natural_step, Random& random) {
    Way way;
    way.options.method = method;
    way.options.order = one_of({0, 0, 0, 4}, random);
    way.options.step = natural_step * one_of({0.1, 1.0, 1.0, 4.0, 10.0}, random);
    way.options.dense_limit = one_of({40, 0}, random);
    way.options.substeps = one_of({1, 4}, random);
    way.options.compensated_sums = one_of({false, false, true}, random);
    way.solver.jacobian = one_of(
        {JacobianPolicy::automatic, JacobianPolicy::fresh, JacobianPolicy::per_step, JacobianPolicy::kept},
        random);
    way.solver.iteration =
        one_of({Iteration::newton, Iteration::newton, Iteration::fixed_point, Iteration::automatic}, random);
    way.solver.anderson = one_of({0, 0, 2}, random);
    return way;
  }

  /// None where the scene and the method do not go together.
  std::optional<Integrator> integrator(const CatalogueScene& entry) const {
    static const Registry registry = Registry::with_built_ins();
    try {
      return Integrator(entry.scene, registry, kinsol(solver), options);
    } catch (const Misuse&) {
      return std::nullopt;
    }
  }

  std::string text() const {
    return options.method + ", order " + std::to_string(options.order) + ", step " +
           std::to_string(options.step) + ", dense limit " + std::to_string(options.dense_limit) +
           ", substeps " + std::to_string(options.substeps) + ", compensated " +
           std::to_string(options.compensated_sums) + ", " + name(solver.jacobian) + ", " +
           name(solver.iteration) + ", anderson " + std::to_string(solver.anderson);
  }
};

/// What the walks have met, so that the test is known to have seen it.
struct Met {
  int walks = 0, failures = 0, after_retries = 0;
  Retries retries;
};

void walk(const CatalogueScene& entry, const Way& way, Random& random, Met& met) {
  std::optional<Integrator> whole = way.integrator(entry), second = way.integrator(entry);
  if (!whole) return;
  ++met.walks;
  Snapshot before = whole->save(), long_before = before;
  bool steps_back = false, retried = false;
  for (int k = 0; k < calls; ++k) {
    Call call = Call::drawn(way.options.step, random);
    if (call.kind == Call::retry && !steps_back) call.kind = Call::step;
    const bool done = call(*whole);
    if (call.kind != Call::minus) steps_back = done;
    if (!done) ++met.failures;
    const Snapshot after = whole->save();
    if (call.kind == Call::minus) {
      EXPECT_EQ(differences(before, after), 0) << "reading left a trace";
    }
    if (call.kind != Call::retry) {  // which a restored integrator refuses
      second->restore(long_before);
      (void)second->step(1.7 * way.options.step);
      second->restore(before);
      EXPECT_EQ(call(*second), done);
      EXPECT_EQ(differences(second->save(), after), 0) << "call " << k << " of kind " << call.kind;
      if (retried) ++met.after_retries;
    }
    retried = call.kind == Call::retry;
    if (random() % 4 == 0) long_before = before;
    before = after;
  }
  const Retries& retries = whole->work().retries;
  met.retries.line_searches += retries.line_searches;
  met.retries.continuations += retries.continuations;
  met.retries.other_branches += retries.other_branches;
  met.retries.divided_steps += retries.divided_steps;
}

/// Every so-many-th pair of a scene and a method.
Met walks(int every) {
  Random random(1);
  Met met;
  int pair = 0;
  for (const std::string& name : scene_names()) {
    const CatalogueScene entry = make_scene(name);
    if (entry.scene->dimension() > max_coordinates) continue;
    for (const std::string& method : Registry::with_built_ins().names()) {
      if (pair++ % every != 0) continue;
      for (int k = 0; k < ways_to_solve; ++k) {
        const Way way = Way::drawn(method, entry.natural_step, random);
        SCOPED_TRACE(name + ", " + way.text());
        walk(entry, way, random, met);
      }
    }
  }
  return met;
}

TEST(RestoredRun, GoesOnWithTheSameBitsWhateverWentBefore) {
  const Met met = walks(4);
  EXPECT_GT(met.walks, 200);
  EXPECT_GT(met.failures, 20);
  EXPECT_GT(met.after_retries, 20);
}

TEST(RestoredRun, GoesOnWithTheSameBitsFromEverySceneAndMethod_slow) {
  const Met met = walks(1);
  EXPECT_GT(met.walks, 500);
  EXPECT_GT(met.failures, 50);
  EXPECT_GT(met.after_retries, 50);
  EXPECT_GT(met.retries.line_searches, 50);
  EXPECT_GT(met.retries.continuations, 50);
  EXPECT_GT(met.retries.other_branches, 0);
  EXPECT_GT(met.retries.divided_steps, 0);
}

}  // namespace
}  // namespace diracstep
