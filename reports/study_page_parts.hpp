#pragma once

#include <string_view>

/// The files of study_page/, as they stand; `body_view`, body_view/ as one script with three.js, is empty
/// where the build did not find three.js.
namespace diracstep::study_page_parts {

extern const std::string_view style, plot, motion, page, body_view;

}  // namespace diracstep::study_page_parts
