#include <array>
#include <concepts>
#include <cstdlib>
#include <diracstep/plugins/loaded_plugin.hpp>
#include <diracstep/plugins/plugin.hpp>
#include <diracstep/validation/laws/conformance_suite.hpp>
#include <set>
#include <vector>

namespace diracstep::testing {
namespace {

/// What is planted into the midpoint discrete Lagrangian.
enum class Fault {
  none,
  wrong_sign_in_d2,
  wrong_hessian,
  asymmetric_gradient,
  allocates,
  shares_a_workspace,
  swallows_nan,
  forgets_the_step,
};

/// S = h L((q0+q1)/2, (q1−q0)/h) by hand, as a plugin in C would write it.
struct Midpoint {
  const Fault* fault;
  std::array<double, 3> q, v, lq, lv;
  static inline std::array<double, 3> shared{};

  double* velocity() { return *fault == Fault::shares_a_workspace ? shared.data() : v.data(); }

  void move_to(const diracstep_system& system, diracstep_interval step, const double* y) {
    for (int i = 0; i < system.dimension; ++i) {
      const double a = y[i], b = y[system.dimension + i];
      q[static_cast<std::size_t>(i)] = 0.5 * (a + b);
      velocity()[i] = (b - a) / (*fault == Fault::forgets_the_step ? 0.05 : step.size);
    }
  }

  int gradient(const diracstep_system& system, diracstep_interval step, const double* y, double* g) {
    const int n = system.dimension;
    const double middle = step.start + step.size / 2.0, sign = *fault == Fault::wrong_sign_in_d2 ? -1.0 : 1.0;
    move_to(system, step, y);
    if (*fault == Fault::allocates) std::free(std::malloc(100));
    if (system.lagrangian.gradient(system.lagrangian.data, middle, q.data(), velocity(), lq.data(),
                                   lv.data()) != 0)
      return 1;
    for (std::size_t i = 0; i < 3; ++i) {
      g[i] = 0.5 * step.size * lq[i] - lv[i];
      g[static_cast<std::size_t>(n) + i] = sign * (0.5 * step.size * lq[i] + lv[i]);
    }
    if (*fault == Fault::asymmetric_gradient) g[0] += 0.05 * step.size * y[1];
    if (*fault == Fault::swallows_nan)
      for (int i = 0; i < 2 * n; ++i)
        if (g[i] != g[i]) g[i] = 0.0;
    return 0;
  }
};

const diracstep_method& faulty_method(const Fault* fault) {
  static diracstep_method method{};
  method = {};
  method.name = "type1/mine";
  method.type = 1;
  method.order = 2;
  method.flags = DIRACSTEP_SELF_ADJOINT;
  method.data = fault;
  method.create = [](const void* data, const diracstep_system*, void** self) {
    *self = new Midpoint{static_cast<const Fault*>(data), {}, {}, {}, {}};
    return 0;
  };
  method.destroy = [](void* self) { delete static_cast<Midpoint*>(self); };
  method.value = [](void* self, const diracstep_system* system, diracstep_interval step, const double* y,
                    double* s) {
    auto& made = *static_cast<Midpoint*>(self);
    made.move_to(*system, step, y);
    const int status = system->lagrangian.value(system->lagrangian.data, step.start + step.size / 2.0,
                                                made.q.data(), made.velocity(), s);
    *s *= step.size;
    return status;
  };
  method.gradient = [](void* self, const diracstep_system* system, diracstep_interval step, const double* y,
                       double* g) { return static_cast<Midpoint*>(self)->gradient(*system, step, y, g); };
  return method;
}

const std::vector<OrderScene>& scenes() {
  static const std::vector<OrderScene> made = order_scenes();
  return made;
}

/// The checks that fail on a method with this fault, further changed by `change`.
template <std::invocable<diracstep_method&> Change>
std::set<std::string> failing(Fault fault, Change change, const std::string& only = {}) {
  diracstep_method method = faulty_method(&fault);
  change(method);
  const diracstep_method* methods[] = {&method};
  const diracstep_plugin description{DIRACSTEP_PLUGIN_VERSION,
                                     sizeof(diracstep_plugin),
                                     "mine",
                                     nullptr,
                                     1,
                                     methods,
                                     0,
                                     nullptr,
                                     0,
                                     nullptr};
  Registry registry = Registry::with_built_ins();
  Plugin(&description).add_to(registry);
  const auto wanted = [&](const std::string& name) { return only.empty() || name == only; };
  std::set<std::string> names;
  for (const Check& check :
       check_method(registry, "type1/mine", scenes(), {allocation_counter(), wanted}).checks)
    if (check.result == Check::Result::fail) names.insert(check.name);
  return names;
}
std::set<std::string> failing(Fault fault, const std::string& only = {}) {
  return failing(
      fault, [](diracstep_method&) {}, only);
}

using Names = std::set<std::string>;

TEST(PlantedFault, NoneIsFoundWhereThereIsNone) { EXPECT_EQ(failing(Fault::none), Names{}); }

TEST(PlantedFault, WrongSignInTheDerivativeByTheEnd) {
  EXPECT_TRUE(failing(Fault::wrong_sign_in_d2, "gradient").contains("gradient"));
}

TEST(PlantedFault, AGradientOfNoFunction) {
  EXPECT_TRUE(failing(Fault::asymmetric_gradient, "hessian").contains("hessian"));
  EXPECT_TRUE(failing(Fault::asymmetric_gradient, "symplecticity").contains("symplecticity"));
  // Without S itself it is still found.
  EXPECT_TRUE(failing(
                  Fault::asymmetric_gradient, [](diracstep_method& m) { m.value = nullptr; }, "hessian")
                  .contains("hessian"));
}

TEST(PlantedFault, AWrongHessian) {
  const auto wrong = [](diracstep_method& method) {
    method.hessian = [](void*, const diracstep_system*, diracstep_interval step, const double*,
                        double* blocks) {
      for (int k = 0; k < 27; ++k) blocks[k] = (k % 9 % 4 == 0 ? (k / 9 == 1 ? -1.0 : 1.0) : 0.0) / step.size;
      return 0;
    };
  };
  EXPECT_TRUE(failing(Fault::wrong_hessian, wrong, "hessian").contains("hessian"));
}

TEST(PlantedFault, OrderClaimedTooHigh) {
  const Names names = failing(Fault::none, [](diracstep_method& m) { m.order = 4; });
  EXPECT_EQ(names, (Names{"order, unconstrained", "order, holonomic", "order, nonholonomic", "order, mixed",
                          "order, affine, driven", "order, forced, mixed"}));
  EXPECT_EQ(failing(Fault::none,
                    [](diracstep_method& m) {
                      m.order = 4;
                      m.constrained_order = 2;
                    }),
            Names{"order, unconstrained"});
}

TEST(PlantedFault, FalseSelfAdjointness_slow) {
  const auto one_sided = [](diracstep_method& method) {
    method.order = 1;
    method.constraint_rule = "left";
    method.gradient = nullptr;
    method.value = [](void* self, const diracstep_system* system, diracstep_interval step, const double* y,
                      double* s) {
      auto& made = *static_cast<Midpoint*>(self);
      made.move_to(*system, step, y);
      *s = 0.0;
      const int status = system->lagrangian.value(system->lagrangian.data, step.start, y, made.v.data(), s);
      *s *= step.size;
      return status;
    };
  };
  EXPECT_EQ(failing(Fault::none, one_sided), Names{"self-adjointness"});
}

TEST(PlantedFault, AnInconsistentStep) {
  EXPECT_TRUE(failing(Fault::forgets_the_step, "consistency").contains("consistency"));
}

TEST(PlantedFault, AllocationDespiteTheClaim) {
  if (!counts_allocations) GTEST_SKIP() << "allocations are not counted in this build";
  const auto with_hessian = [](diracstep_method& method) {
    method.flags |= DIRACSTEP_ALLOCATION_FREE;
    method.hessian = [](void*, const diracstep_system*, diracstep_interval, const double*, double*) {
      return 0;
    };
  };
  EXPECT_TRUE(failing(Fault::allocates, with_hessian, "allocation").contains("allocation"));
  EXPECT_FALSE(failing(Fault::none, with_hessian, "allocation").contains("allocation"));
  EXPECT_FALSE(failing(Fault::allocates, "allocation").contains("allocation"));  // not claimed
}

TEST(Fallback, DifferencesAllocateNothingWhereThePluginStatesSo) {
  if (!counts_allocations) GTEST_SKIP() << "allocations are not counted in this build";
  const auto claimed = [](diracstep_method& method) { method.flags |= DIRACSTEP_ALLOCATION_FREE; };
  EXPECT_FALSE(failing(Fault::none, claimed, "allocation").contains("allocation"));  // ∂²S by differences
  const auto value_alone = [](diracstep_method& method) {
    method.flags |= DIRACSTEP_ALLOCATION_FREE;
    method.gradient = nullptr;
  };
  EXPECT_FALSE(failing(Fault::none, value_alone, "allocation").contains("allocation"));
}

TEST(PlantedFault, InstancesThatShareAWorkspace) {
  EXPECT_EQ(failing(Fault::shares_a_workspace), Names{"two instances"});
}

TEST(PlantedFault, NaNThatIsSwallowed) {
  EXPECT_TRUE(failing(Fault::swallows_nan, "not a number").contains("not a number"));
}

TEST(Fallback, EveryAmountOfDerivativesPasses_slow) {
  EXPECT_EQ(failing(Fault::none, [](diracstep_method& m) { m.gradient = nullptr; }), Names{});
  EXPECT_EQ(failing(Fault::none, [](diracstep_method& m) { m.value = nullptr; }), Names{});
}

TEST(Rules, ARuleOfAPluginHasTheOrderOfItsNodes) {
  Registry registry = Registry::with_built_ins();
  registry.add_rule(step_rule("simpson", {{0.0, 1.0 / 6.0}, {0.5, 4.0 / 6.0}, {1.0, 1.0 / 6.0}}));
  registry.add_rule(step_rule("early", {{0.25, 1.0}}));
  EXPECT_TRUE(check_rule(registry, "simpson", scenes()).passed());
  EXPECT_TRUE(check_rule(registry, "early", scenes()).passed());
  EXPECT_EQ(mirrored(registry.rule("early")).nodes().front().c, 0.75);
  EXPECT_EQ(mirrored(mirrored(registry.rule("early"))), registry.rule("early"));
}

/// The plugins of examples/, by the suite that their authors would use.
const int registered = [] {
  Registry registry = Registry::with_built_ins();
  std::vector<std::string> methods;
  for (const char* name : {"harmonic", "galerkin"}) {
    const Plugin plugin = load_plugin(std::string(DIRACSTEP_TEST_PLUGINS "/") + name + ".so");
    plugin.add_to(registry);
    methods.insert(methods.end(), plugin.methods().begin(), plugin.methods().end());
  }
  methods.insert(methods.end(), {"type2/legendre(type1/galerkin2)", "type1/midpoint", "type2/euler"});
  register_conformance_tests(registry, methods);
  return 0;
}();

}  // namespace
}  // namespace diracstep::testing
