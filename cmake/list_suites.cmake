# Writes what ctest runs of a Google Test program, an entry for each of its suites: starting the program costs more than most tests.
#   cmake -D NAME=PROGRAM -D PROGRAM=FILE -D OUTPUT=FILE -D PROPERTIES="NAME VALUE..." -P list_suites.cmake
execute_process(COMMAND ${PROGRAM} --gtest_list_tests OUTPUT_VARIABLE listed COMMAND_ERROR_IS_FATAL ANY TIMEOUT 60)
string(REGEX MATCHALL "\n[^ \n]+\\.( |\n)" suites "\n${listed}")
set(entries "")
foreach(suite ${suites})
  string(REGEX REPLACE "^\n([^ \n]+)\\.( |\n)$" "\\1" suite "${suite}")
  string(APPEND entries "add_test([==[${NAME}.${suite}]==] [==[${PROGRAM}]==] [==[--gtest_filter=${suite}.*]==])\n"
    "set_tests_properties([==[${NAME}.${suite}]==] PROPERTIES ${PROPERTIES})\n")
endforeach()
if(entries STREQUAL "")
  message(FATAL_ERROR "${PROGRAM} has no tests")
endif()
file(WRITE ${OUTPUT} "${entries}")
