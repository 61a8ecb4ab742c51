include_guard()
include(cairn_headers)

# cairn_module(NAME SOURCE source LOADER source TARGET target LIBS library...): lib/cairn/NAME.so, a part of the program that is
# loaded when it is needed (core/modules/module.h): beside the program in the build folder, and below the prefix where it is
# installed.  SOURCE defines cairn_NAME_module, the one name that it exports; LOADER, a source of TARGET, loads it.
function(cairn_module name)
  cmake_parse_arguments(PARSE_ARGV 1 module "" "SOURCE;LOADER;TARGET" "LIBS")
  # Of the same build as the program, or not: a hash of what passes between them, and of all that decides what the module does
  # here, so that a change of the module is one of the program.
  file(RELATIVE_PATH source ${PROJECT_SOURCE_DIR} ${CMAKE_CURRENT_SOURCE_DIR}/${module_SOURCE})
  cairn_reachable_headers(sources ${source})
  set(hashes ${CMAKE_CXX_COMPILER_ID} ${CMAKE_CXX_COMPILER_VERSION} ${OpenCV_VERSION})
  foreach(source ${sources})
    file(SHA256 ${PROJECT_SOURCE_DIR}/${source} hash)
    list(APPEND hashes ${hash})
  endforeach()
  string(SHA256 hash "${hashes}")
  string(SUBSTRING ${hash} 0 16 hash)
  set(version CAIRN_MODULE_VERSION="${PROJECT_VERSION}-${hash}")
  set_property(SOURCE ${CMAKE_CURRENT_SOURCE_DIR}/${module_LOADER} TARGET_DIRECTORY ${module_TARGET}
    APPEND PROPERTY COMPILE_DEFINITIONS ${version})

  add_library(cairn_${name} MODULE ${module_SOURCE})
  set_target_properties(cairn_${name} PROPERTIES
    PREFIX "" OUTPUT_NAME ${name} LIBRARY_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/lib/cairn)
  target_compile_definitions(cairn_${name} PRIVATE ${version})
  target_link_libraries(cairn_${name} PRIVATE ${module_LIBS})
  # Exports one name; what the libraries do not have is an error here, not when the module is loaded.
  set(exports ${CMAKE_CURRENT_BINARY_DIR}/${name}.map)
  file(CONFIGURE OUTPUT ${exports} CONTENT "{ global: cairn_${name}_module; local: *; };\n")
  target_link_options(cairn_${name} PRIVATE -Wl,--version-script=${exports})
  set_target_properties(cairn_${name} PROPERTIES LINK_DEPENDS ${exports})
  if(NOT CAIRN_SANITIZE)
    target_link_options(cairn_${name} PRIVATE -Wl,-z,defs)
  endif()
  # Whatever may load it has it beside it.
  add_dependencies(${module_TARGET} cairn_${name})
  install(TARGETS cairn_${name} DESTINATION lib/cairn COMPONENT program)
endfunction()
