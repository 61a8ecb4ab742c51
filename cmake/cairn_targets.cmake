# One line per target: a stage library, a test program, a benchmark program.

# cairn_precompile(TARGET): its sources begin with cmake/precompiled.h, which is parsed once for all such targets.
function(cairn_precompile target)
  target_precompile_headers(${target} REUSE_FROM cairn_robot_core)
endfunction()

# cairn_unite(TARGET): its sources are compiled eight at a time, which parses headers and instantiates templates once for
# all eight.  Names in their unnamed namespaces have to differ; the other presets compile each source alone.
function(cairn_unite target)
  if(CAIRN_UNITY)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 8)
  endif()
endfunction()

# cairn_library(NAME SOURCES file... LIBS target...): the library cairn_NAME, which needs the compiler's core and arguments.
function(cairn_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LIBS" ${ARGN})
  add_library(cairn_${name} STATIC ${ARG_SOURCES})
  target_link_libraries(cairn_${name} PUBLIC cairn_core cairn_command ${ARG_LIBS})
  cairn_precompile(cairn_${name})
  cairn_unite(cairn_${name})
endfunction()

# cairn_stage(NAME SOURCES file... LIBS target...): the library cairn_NAME of stages/NAME, which the program links.
function(cairn_stage name)
  cairn_library(${name} ${ARGN})
  set_property(GLOBAL APPEND PROPERTY CAIRN_STAGES cairn_${name})
endfunction()

# cairn_test(NAME SOURCES file... LIBS target... [LABEL slow]): the test program NAME; ctest runs its suites, as NAME.Suite.
function(cairn_test name)
  cmake_parse_arguments(ARG "" "LABEL" "SOURCES;LIBS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LIBS} GTest::gmock GTest::gtest_main)
  target_precompile_headers(${name} REUSE_FROM cairn_test_headers)
  cairn_unite(${name})
  if(CMAKE_CROSSCOMPILING)
    return()  # tests/arm64 runs them
  endif()
  # Tests of one program may write files of one name: they run one after the other, in a folder of their own.
  set(folder ${CMAKE_BINARY_DIR}/tests_tmp/${name})
  file(MAKE_DIRECTORY ${folder})
  set(properties "TIMEOUT 1200 RESOURCE_LOCK ${name} ENVIRONMENT TEST_TMPDIR=${folder}")
  if(ARG_LABEL)
    string(APPEND properties " LABELS ${ARG_LABEL}")
  endif()
  set(suites ${CMAKE_CURRENT_BINARY_DIR}/${name}_suites.cmake)
  add_custom_command(TARGET ${name} POST_BUILD VERBATIM COMMENT "" COMMAND ${CMAKE_COMMAND} -D NAME=${name}
    -D PROGRAM=$<TARGET_FILE:${name}> -D OUTPUT=${suites} -D "PROPERTIES=${properties}" -P ${PROJECT_SOURCE_DIR}/cmake/list_suites.cmake)
  file(CONFIGURE OUTPUT ${CMAKE_CURRENT_BINARY_DIR}/${name}_tests.cmake @ONLY CONTENT [[
if(EXISTS "@suites@")
  include("@suites@")
else()
  add_test("@name@" "not_built/@name@")
endif()
]])
  set_property(DIRECTORY APPEND PROPERTY TEST_INCLUDE_FILES ${CMAKE_CURRENT_BINARY_DIR}/${name}_tests.cmake)
endfunction()

# cairn_benchmark(NAME SOURCES file... LIBS target...): a Google Benchmark program.
function(cairn_benchmark name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LIBS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LIBS} benchmark::benchmark)
endfunction()

# cairn_embed_sql(TARGET file...): compiles SQL files of schemas/ into a library.  schemas/world.sql becomes the header
# "schemas/world_sql.h" with the text `cairn::kWorldSql`.
function(cairn_embed_sql target)
  foreach(file ${ARGN})
    cmake_path(ABSOLUTE_PATH file OUTPUT_VARIABLE path)
    get_filename_component(stem ${file} NAME_WE)
    file(READ ${path} SQL)
    set(SYMBOL "k")
    string(REPLACE "_" ";" words ${stem})
    foreach(word ${words})
      string(SUBSTRING ${word} 0 1 initial)
      string(SUBSTRING ${word} 1 -1 rest)
      string(TOUPPER ${initial} initial)
      string(APPEND SYMBOL ${initial} ${rest})
    endforeach()
    file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/embedded/schemas/${stem}_sql.h @ONLY CONTENT
"#pragma once
namespace cairn {
inline constexpr char @SYMBOL@Sql[] = R\"sql(@SQL@)sql\";
}  // namespace cairn
")
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${path})
  endforeach()
  target_include_directories(${target} PRIVATE ${CMAKE_BINARY_DIR}/embedded)
endfunction()

# cairn_embed_text(TARGET NAME FILE): a text file as a constant: NAME leaflet_css becomes the header "report/leaflet_css.h" with
# `cairn::kLeafletCssText`.
function(cairn_embed_text target name file)
  file(READ ${file} TEXT)
  set(SYMBOL "k")
  string(REPLACE "_" ";" words ${name})
  foreach(word ${words})
    string(SUBSTRING ${word} 0 1 initial)
    string(TOUPPER ${initial} initial)
    string(SUBSTRING ${word} 1 -1 rest)
    string(APPEND SYMBOL ${initial} ${rest})
  endforeach()
  file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/embedded/report/${name}.h @ONLY CONTENT
"#pragma once
namespace cairn {
inline constexpr char @SYMBOL@Text[] = R\"embedded(@TEXT@)embedded\";
}  // namespace cairn
")
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${file})
  target_include_directories(${target} PRIVATE ${CMAKE_BINARY_DIR}/embedded)
endfunction()
