#pragma once

#include <diracstep/plugins/diracstep_scene.h>

#include <diracstep/core/system/scene.hpp>
#include <memory>
#include <string>

namespace diracstep {

/// A pattern from its C form, `columns` columns of `rows` rows.  Throws Misuse where its numbers are no
/// pattern, saying whose it is.
SparsityPattern pattern_from(const diracstep_pattern& pattern, int rows, int columns,
                             const std::string& owner);

/// A scene whose functions are C callbacks; derivatives that are not given are taken by differences.
/// `owner` stands in messages: "plugin 'x', scene 'y'".  `library` is kept as long as any part of the scene.
/// Throws Misuse where a part is missing or sizes disagree.  A callback that fails throws CallbackError when
/// it is called.
Scene scene_from(const diracstep_scene& scene, const std::string& owner,
                 std::shared_ptr<const void> library = {});

}  // namespace diracstep
