# Puts the shaders of assets/shaders into the program: a header with one string a file, so that nothing has to be found when
# the program runs. Written at configure time; a changed shader configures again.
#
# parallax_embed_shaders(TARGET): <parallax_shaders.h> for TARGET, with parallax::shaders::NAME for NAME.glsl.
function(parallax_embed_shaders target)
  file(GLOB shaders CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/assets/shaders/*.glsl")
  set(text "// Written by cmake/Shaders.cmake from assets/shaders.\n#pragma once\n\nnamespace parallax::shaders {\n\n")
  foreach(shader IN LISTS shaders)
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${shader}")
    get_filename_component(name "${shader}" NAME_WE)
    file(READ "${shader}" source)
    string(APPEND text "inline constexpr const char* ${name} = R\"glsl(${source})glsl\";\n\n")
  endforeach()
  string(APPEND text "}  // namespace parallax::shaders\n")
  file(CONFIGURE OUTPUT "${PROJECT_BINARY_DIR}/generated/shaders/parallax_shaders.h" CONTENT "@text@" @ONLY)
  target_include_directories(${target} PRIVATE "${PROJECT_BINARY_DIR}/generated/shaders")
endfunction()
