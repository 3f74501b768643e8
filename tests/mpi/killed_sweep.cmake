# SPDX-License-Identifier: MIT
# Starts PROGRAM (journal.cpp) with MPIRUN, kills one of its processes in the middle of its sweep, leaves a line torn as
# well, and has it resumed: only what is missing may run.
cmake_minimum_required(VERSION 3.22)

file(REMOVE_RECURSE "${SCRATCH}")
file(MAKE_DIRECTORY "${SCRATCH}")
foreach(kill IN ITEMS 10 11)  # in process 0, and in process 1
  set(journal "${SCRATCH}/${kill}.journal")
  execute_process(COMMAND ${MPIRUN} "${PROGRAM}" "${journal}" ${kill} 99
                  RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(status EQUAL 0)
    message(FATAL_ERROR "killed in job ${kill}, it ended well:\n${output}")
  endif()
  file(STRINGS "${journal}" lines REGEX "^job [0-9]+\t")
  list(LENGTH lines known)
  if(known LESS 4 OR known GREATER 18)
    message(FATAL_ERROR "${known} results were there when job ${kill} was killed:\n${output}")
  endif()
  # the last line may not be whole as it is; now it is not in any case
  file(READ "${journal}" text)
  string(FIND "${text}" "\n" end REVERSE)
  math(EXPR end "${end} + 1")
  string(SUBSTRING "${text}" 0 ${end} whole)
  string(REGEX MATCHALL "\njob [0-9]+\t" lines "${whole}")
  list(LENGTH lines known)
  file(WRITE "${journal}" "${whole}job 19\t3\t1.5\t2")
  math(EXPR missing "20 - ${known}")
  foreach(expected IN ITEMS ${missing} 0)
    execute_process(COMMAND ${MPIRUN} "${PROGRAM}" "${journal}" 99 ${expected}
                    RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
    if(NOT status EQUAL 0)
      message(FATAL_ERROR "resumed, with ${expected} jobs missing: ${status}\n${output}")
    endif()
  endforeach()
  file(STRINGS "${journal}" lines)
  list(LENGTH lines lines)
  if(NOT lines EQUAL 21)
    message(FATAL_ERROR "${journal} has ${lines} lines in place of 21")
  endif()
endforeach()
