#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/plugins/callback_error.hpp>
#include <diracstep/plugins/callback_scene.hpp>
#include <diracstep/plugins/loaded_plugin.hpp>
#include <diracstep/plugins/plugin.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>
#include <law_scenes.hpp>

#include "misuse.hpp"
#include "temporary_folder.hpp"

namespace diracstep::testing {
namespace {

namespace fs = std::filesystem;

fs::path built(const std::string& name) { return fs::path(DIRACSTEP_TEST_PLUGINS) / (name + ".so"); }

Registry with(const std::string& name) {
  Registry registry = Registry::with_built_ins();
  load_plugin(built(name)).add_to(registry);
  return registry;
}

std::unique_ptr<Integrator> stepping(const Registry& registry, const std::string& method) {
  return std::make_unique<Integrator>(laws::unconstrained(), registry, kinsol(),
                                      IntegratorOptions{.method = method, .step = 0.05});
}

/// Whether a fresh integrator of a built-in method still works: the host goes on.
bool host_goes_on(const Registry& registry) { return stepping(registry, "type1/midpoint")->step().ok(); }

TEST(Loader, WhatAPluginBringsIsThere) {
  const Plugin plugin = load_plugin(built("galerkin"));
  EXPECT_EQ(plugin.name(), "galerkin");
  EXPECT_EQ(plugin.methods(), std::vector<std::string>{"type1/galerkin2"});
  EXPECT_EQ(plugin.rules(), std::vector<std::string>{"simpson"});
  Registry registry = Registry::with_built_ins();
  plugin.add_to(registry);
  const MethodInfo info = registry.method("type1/galerkin2").info;
  EXPECT_EQ(info.order, 4);
  EXPECT_EQ(info.constrained_order, 2);
  EXPECT_TRUE(info.self_adjoint);
  EXPECT_EQ(registry.rule("simpson").nodes().size(), 3u);
  EXPECT_EQ(registry.method("type2/legendre(type1/galerkin2)").info.type, GeneratingType::two);
}

TEST(Loader, TheObjectStaysLoadedAsLongAsItIsUsed) {
  std::unique_ptr<Integrator> integrator;
  {
    const Registry registry = with("harmonic");
    integrator = stepping(registry, "type1/harmonic");
  }
  EXPECT_TRUE(integrator->step().ok());
}

TEST(Loader, RefusesWhatIsNoPlugin) {
  expect_misuse([] { load_plugin("no/such/file.so"); }, {"no/such/file.so", "no such file"});
  const TemporaryFolder folder;
  const std::string text = folder.write("no_object.so", "this is text\n");
  expect_misuse([&] { load_plugin(text); }, {text, "cannot be loaded"});
  expect_misuse([] { load_plugin(built("faulty_0")); },
                {"faulty_0", "does not export diracstep_plugin_entry"});
}

TEST(Loader, RefusesAnObjectThatWasCutOff) {
  const std::string whole = contents(built("harmonic"));
  ASSERT_GT(whole.size(), 8000u);
  const TemporaryFolder folder;
  for (const std::size_t size : {0, 10, 64, 500, 3000, 6000}) {  // behind it is what a debugger reads
    const std::string cut = folder.write("cut.so", whole.substr(0, size));
    expect_misuse([&] { load_plugin(cut); }, {cut, "cannot be loaded"});
  }
}

TEST(Loader, RefusesNamesThatAreMissing) {
  const double start[] = {1.0, 0.0};
  const char* const names[] = {"x", nullptr};
  const diracstep_function lagrangian{
      nullptr, {},     0, [](const void*, double, const double*, const double*, double*) { return 0; },
      nullptr, nullptr};
  diracstep_scene scene{};
  scene.name = "mine";
  scene.dimension = 2;
  scene.coordinates = names;
  scene.lagrangian = &lagrangian;
  scene.start_q = scene.start_v = start;
  expect_misuse([&] { (void)scene_from(scene, "plugin 'mine'", {}); }, {"coordinate 2 has no name"});
}

TEST(Loader, RefusesAnotherVersionNamingBoth) {
  const std::string theirs = std::to_string(DIRACSTEP_PLUGIN_VERSION + 6);
  const std::string ours = std::to_string(DIRACSTEP_PLUGIN_VERSION);
  expect_misuse([] { load_plugin(built("faulty_1")); },
                {"faulty_1", "version " + theirs, "has " + ours, "rebuild"});
}

TEST(Loader, ADuplicateNameLeavesTheRegistryAsItWas) {
  Registry registry = with("galerkin");
  const auto before = registry.names();
  expect_misuse([&] { load_plugin(built("faulty_2")).add_to(registry); },
                {"plugin 'faulty'", "'type1/midpoint' is already registered"});
  expect_misuse([&] { load_plugin(built("galerkin")).add_to(registry); },
                {"'simpson' is already registered"});
  EXPECT_EQ(registry.names(), before);
  EXPECT_TRUE(host_goes_on(registry));
}

TEST(Callbacks, AnErrorSaysWhoseItIsAndTheHostGoesOn) {
  const Registry registry = with("faulty_3");
  const auto integrator = stepping(registry, "type1/faulty");
  try {
    for (int k = 0; k < 10; ++k) (void)integrator->step();
    ADD_FAILURE() << "no error";
  } catch (const CallbackError& error) {
    expect_parts(error.what(), {"plugin 'faulty', method 'type1/faulty'", "value returned error 42",
                                "the answer is refused"});
  }
  integrator->reset();
  EXPECT_TRUE(integrator->step().ok());
  EXPECT_TRUE(host_goes_on(registry));
}

TEST(Callbacks, NaNEndsInTheReportOfAStep) {
  const Registry registry = with("faulty_4");
  const auto integrator = stepping(registry, "type1/faulty");
  StepReport report;
  for (int k = 0; k < 10 && report.ok(); ++k) report = integrator->step();
  EXPECT_EQ(report.solve.status, SolveStatus::not_finite);
  expect_parts(report.failure, {"step 3", "not finite"});
  EXPECT_TRUE(integrator->position().allFinite());
  EXPECT_TRUE(host_goes_on(registry));
}

TEST(Callbacks, AnExceptionSaysWhoseItIsAndTheHostGoesOn) {
  const Registry registry = with("throwing");
  const auto integrator = stepping(registry, "type1/throwing");
  try {
    (void)integrator->step();
    ADD_FAILURE() << "no error";
  } catch (const CallbackError& error) {
    expect_parts(error.what(), {"plugin 'throwing'", "threw: thrown in the plugin"});
  }
  EXPECT_TRUE(host_goes_on(registry));
}

/// A Lagrangian of the host that throws while the plugin asks it.
TEST(Callbacks, AnErrorOfTheScenePassesThroughThePlugin) {
  struct Refused {};
  Scene scene = laws::particle("refusing");
  scene.lagrangian = lagrangian<3>([](const auto& q, const auto& v, const auto& t) {
    if (t > 0.2) throw Refused{};
    return laws::Particle{}(q, v);
  });
  for (const char* plugin : {"harmonic", "galerkin"}) {
    const Registry registry = with(plugin);
    const std::string method = plugin == std::string("harmonic") ? "type1/harmonic" : "type1/galerkin2";
    Integrator integrator(std::make_shared<const Scene>(scene), registry, kinsol(),
                          {.method = method, .step = 0.05});
    EXPECT_THROW(
        {
          for (int k = 0; k < 10; ++k) (void)integrator.step();
        },
        Refused)
        << plugin;
  }
}

/// Descriptions that are refused, each changed in one place.
TEST(Description, EveryPartIsLookedAt) {
  const auto refused = [](auto change, std::initializer_list<std::string> parts) {
    diracstep_method method{};
    method.name = "type1/mine";
    method.type = 1;
    method.order = 1;
    method.value = [](void*, const diracstep_system*, diracstep_interval, const double*, double*) {
      return 0;
    };
    const double node = 0.5, weight = 1.0;
    diracstep_rule rule{"centre", 1, &node, &weight};
    const diracstep_method* methods[] = {&method};
    const diracstep_rule* rules[] = {&rule};
    diracstep_plugin plugin{DIRACSTEP_PLUGIN_VERSION,
                            sizeof(diracstep_plugin),
                            "mine",
                            nullptr,
                            1,
                            methods,
                            1,
                            rules,
                            0,
                            nullptr};
    change(plugin, method, rule);
    expect_misuse(
        [&] {
          Registry registry = Registry::with_built_ins();
          Plugin(&plugin).add_to(registry);
        },
        parts);
  };
  using P = diracstep_plugin;
  using M = diracstep_method;
  using R = diracstep_rule;
  refused([](P& p, M&, R&) { p.size -= 8; }, {"size", std::to_string(sizeof(diracstep_plugin))});
  refused([](P& p, M&, R&) { p.name = nullptr; }, {"no name"});
  refused([](P& p, M&, R&) { p.methods = -1; }, {"methods", "-1"});
  refused([](P&, M& m, R&) { m.name = nullptr; }, {"method 1"});
  refused([](P&, M& m, R&) { m.type = 5; }, {"type1/mine", "type is 5", "1 to 4"});
  refused([](P&, M& m, R&) { m.type = 2; }, {"type1/mine", "type2/"});
  refused([](P&, M& m, R&) { m.order = 0; }, {"order 0"});
  refused([](P&, M& m, R&) { m.inner_columns = -2; }, {"-2 inner columns"});
  refused([](P&, M& m, R&) { m.inner_columns = 2147483647; }, {"2147483647 inner columns", "0 to 1000"});
  refused([](P&, M& m, R&) { m.value = nullptr; }, {"value and gradient are NULL"});
  refused([](P&, M& m, R&) { m.destroy = [](void*) {}; }, {"create and destroy"});
  refused([](P&, M& m, R&) { m.constraint_rule = "middle"; }, {"'middle'", "midpoint", "centre"});
  refused([](P&, M&, R& r) { r.name = "left"; }, {"'left' is already registered"});
  refused(
      [](P&, M&, R& r) {
        static const double two = 2.0;
        r.weights = &two;
      },
      {"centre", "add up to 2"});
  refused(
      [](P&, M&, R& r) {
        static const double two = 2.0;
        r.c = &two;
      },
      {"centre", "node is 2"});
}

TEST(Search, FindsObjectsInOrderAndTellsOfDirectories) {
  const PluginSearch search = find_plugins("/no/such/directory:" DIRACSTEP_TEST_PLUGINS);
  ASSERT_EQ(search.complaints.size(), 1u);
  expect_parts(search.complaints[0], {"/no/such/directory"});
  EXPECT_TRUE(std::ranges::is_sorted(search.files));
  EXPECT_NE(std::ranges::find(search.files, built("harmonic")), search.files.end());
  EXPECT_TRUE(find_plugins("").files.empty());
}

}  // namespace
}  // namespace diracstep::testing
