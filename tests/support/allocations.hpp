#pragma once

#include <count_allocations.hpp>

/// To be included in one source of a test program.
namespace diracstep::testing {

using diracstep::allocations;
using diracstep::counts_allocations;

}  // namespace diracstep::testing
