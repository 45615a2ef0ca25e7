#pragma once

#include <diracstep/command/run_control.hpp>
#include <diracstep/command/session.hpp>
#include <string>
#include <utility>
#include <vector>

namespace diracstep::command {

/// What makes a run the one it is: everything that its bits depend on, by name.  The scene file entry by
/// entry (scene_definition), parameters, start, method, solver and options; the program, its compiler and
/// libraries; the processor, the C library and the bits of its mathematical functions; plugins by the SHA-256
/// of their files.  The end of the run is not in it: a run may be resumed to another end.
std::vector<std::pair<std::string, std::string>> run_identity(const CatalogueScene& entry,
                                                              const Session& session,
                                                              const MethodChoice& choice,
                                                              const Integrator& integrator,
                                                              const Keeping& keeping, bool to_file);

}  // namespace diracstep::command
