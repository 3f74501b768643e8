# SPDX-License-Identifier: MIT
# Has the same liquid fitted by one process and by two: output, JSON and journal have to be the same, and to be there
# once.
cmake_minimum_required(VERSION 3.22)

file(REMOVE_RECURSE "${SCRATCH}")
file(MAKE_DIRECTORY "${SCRATCH}")
set(options --learn "${RECORDING}" --method both --most-evaluations 9 --spacing-mm 12)
foreach(kind IN ITEMS threads processes)
  set(program "${BY_THREADS}")
  if(kind STREQUAL "processes")
    set(program ${MPIRUN} "${BY_PROCESSES}")
  endif()
  execute_process(COMMAND ${program} ${options} --threads 1 --journal "${SCRATCH}/${kind}.journal" --json "${SCRATCH}/${kind}.json"
                  RESULT_VARIABLE status OUTPUT_VARIABLE said_by_${kind} ERROR_VARIABLE errors)
  if(NOT status EQUAL 0)
    message(FATAL_ERROR "by ${kind}: ${status}\n${errors}")
  endif()
  file(READ "${SCRATCH}/${kind}.json" json)
  string(JSON json_by_${kind} REMOVE "${json}" seconds)
  file(STRINGS "${SCRATCH}/${kind}.journal" lines)
  list(SORT lines)  # jobs end in any order
  set(journal_by_${kind} "${lines}")
endforeach()
foreach(what IN ITEMS said json journal)
  if(NOT ${what}_by_threads STREQUAL ${what}_by_processes)
    message(FATAL_ERROR "${what}: by threads\n${${what}_by_threads}\nby processes\n${${what}_by_processes}")
  endif()
endforeach()

# what one process finds wrong, all of them end by
execute_process(COMMAND ${MPIRUN} "${BY_PROCESSES}" ${options} --json "${SCRATCH}/nowhere/out.json"
                RESULT_VARIABLE status OUTPUT_QUIET ERROR_VARIABLE errors TIMEOUT 60)
if(NOT status EQUAL 2 OR NOT errors MATCHES "nowhere/out.json")
  message(FATAL_ERROR "a file that cannot be written: ${status}\n${errors}")
endif()
