# LCM, and the message types that lcm-gen (package liblcm-bin) makes of sessions/lcm/*.lcm when the program is built. The package's
# pkg-config file asks for headers of GLib that nothing here needs.
find_path(PARALLAX_LCM_INCLUDE lcm/lcm.h REQUIRED DOC "LCM's headers (package liblcm-dev)")
find_library(PARALLAX_LCM_LIBRARY lcm REQUIRED DOC "LCM's library (package liblcm-dev)")
find_program(PARALLAX_LCM_GEN NAMES lcm-gen REQUIRED DOC "LCM's generator (package liblcm-bin)")

set(lcm_folder "${PROJECT_BINARY_DIR}/generated/lcm")
file(GLOB lcm_types CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/sessions/lcm/*.lcm")
set(lcm_headers)
foreach(types IN LISTS lcm_types)
  file(STRINGS "${types}" structs REGEX "^struct [a-z_]+ ")
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${types}")
  foreach(struct IN LISTS structs)
    string(REGEX REPLACE "^struct ([a-z_]+) .*" "\\1" name "${struct}")
    list(APPEND lcm_headers "${lcm_folder}/parallax_messages/${name}.hpp")
  endforeach()
endforeach()
add_custom_command(
  OUTPUT ${lcm_headers}
  COMMAND "${PARALLAX_LCM_GEN}" --cpp --cpp-hpath "${lcm_folder}" ${lcm_types}
  DEPENDS ${lcm_types}
  COMMENT "Generating the message types"
  VERBATIM)
add_custom_target(parallax_lcm_types DEPENDS ${lcm_headers})
add_library(parallax_lcm INTERFACE)
add_dependencies(parallax_lcm parallax_lcm_types)
target_include_directories(parallax_lcm SYSTEM INTERFACE "${lcm_folder}" "${PARALLAX_LCM_INCLUDE}")
target_link_libraries(parallax_lcm INTERFACE "${PARALLAX_LCM_LIBRARY}")

# Sources that convert messages. Generated code reads numbers of one type through pointers to another.
function(parallax_lcm_sources)
  set_source_files_properties(${ARGN} PROPERTIES COMPILE_OPTIONS "-fno-strict-aliasing" SKIP_UNITY_BUILD_INCLUSION ON
    SKIP_PRECOMPILE_HEADERS ON)
endfunction()
