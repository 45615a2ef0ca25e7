#pragma once

namespace diracstep::command {

/// From now on Ctrl-C or SIGTERM only sets a flag; a second one, two seconds later, ends the process at once.
void catch_interrupts();

/// Whether that flag is set.
bool interrupted();

}  // namespace diracstep::command
