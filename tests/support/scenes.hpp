#pragma once

#include "law_scenes.hpp"

namespace diracstep::testing {
using namespace laws;
}
