// Tests every method of the plugins that are named on the command line.
#include <diracstep/plugins/loaded_plugin.hpp>
#include <diracstep/validation/laws/conformance_suite.hpp>

int main(int count, char** arguments) {
  testing::InitGoogleTest(&count, arguments);
  diracstep::Registry registry = diracstep::Registry::with_built_ins();
  std::vector<std::string> methods;
  for (int k = 1; k < count; ++k) {
    const diracstep::Plugin plugin = diracstep::load_plugin(arguments[k]);
    plugin.add_to(registry);
    methods.insert(methods.end(), plugin.methods().begin(), plugin.methods().end());
  }
  diracstep::register_conformance_tests(registry, methods);
  return RUN_ALL_TESTS();
}
