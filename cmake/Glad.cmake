# OpenGL 3.3 core functions, found at run time: glad (Debian's python3-glad) writes the C source when the program is built.
# Each context carries a table of its own (--mx), so that a window and an off-screen context live in one process. Nothing
# links libGL.
enable_language(C)

find_program(PARALLAX_GLAD NAMES glad REQUIRED DOC "glad's command line (package python3-glad)")

set(glad_folder "${PROJECT_BINARY_DIR}/generated/glad")
add_custom_command(
  OUTPUT "${glad_folder}/src/gl.c" "${glad_folder}/include/glad/gl.h"
  COMMAND "${PARALLAX_GLAD}" --api gl:core=3.3 "--extensions=" --out-path "${glad_folder}" --reproducible --quiet c --mx
  COMMENT "Generating the OpenGL loader"
  VERBATIM)
add_library(parallax_glad STATIC "${glad_folder}/src/gl.c" "${glad_folder}/include/glad/gl.h")
target_include_directories(parallax_glad SYSTEM PUBLIC "${glad_folder}/include")
