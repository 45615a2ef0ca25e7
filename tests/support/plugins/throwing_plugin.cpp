// A plugin whose raw callback throws, which C++ alone can do.
#include <diracstep/plugins/diracstep_plugin.h>

#include <stdexcept>

namespace {

int value(void*, const diracstep_system*, diracstep_interval, const double*, double*) {
  throw std::runtime_error("thrown in the plugin");
}

}  // namespace

extern "C" const diracstep_plugin* diracstep_plugin_entry() {
  static diracstep_method method{};
  method.name = "type1/throwing";
  method.type = 1;
  method.order = 1;
  method.value = value;
  static const diracstep_method* const methods[] = {&method};
  static diracstep_plugin plugin{};
  plugin.version = DIRACSTEP_PLUGIN_VERSION;
  plugin.size = sizeof(diracstep_plugin);
  plugin.name = "throwing";
  plugin.methods = 1;
  plugin.method = methods;
  return &plugin;
}
