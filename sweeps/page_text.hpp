#pragma once

#include <string_view>

namespace diracstep {

/// page/page.html as it stands, with {scene} and {data} where these belong.
extern const std::string_view sweep_page_text;

}  // namespace diracstep
