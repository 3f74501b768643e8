# SPDX-License-Identifier: MIT
# Opens REPORT, a page with a film unless FILM=no, in Chromium without a window of its own, and uses it as a reader would
# (browser.js).
# BROKEN=yes takes the slider's connection out of the page's script first, and expects that this is noticed.
cmake_minimum_required(VERSION 3.22)

find_program(browser NAMES chromium chromium-browser google-chrome)
if(browser)  # Ubuntu has one by that name which only says what else to install
  execute_process(COMMAND "${browser}" --version RESULT_VARIABLE status OUTPUT_QUIET ERROR_QUIET)
endif()
if(NOT browser OR NOT status EQUAL 0)
  message(STATUS "skipped: no Chromium to open ${REPORT} with")
  return()
endif()

set(place_in_film "#film=0&picture=1")
if(DEFINED FILM AND NOT FILM)
  set(place_in_film "")
endif()

file(REMOVE_RECURSE "${SCRATCH}")
file(MAKE_DIRECTORY "${SCRATCH}")
file(READ "${REPORT}" page)
string(LENGTH "${page}" bytes)
if(bytes GREATER 8000000)
  message(FATAL_ERROR "${REPORT} has ${bytes} bytes")
endif()
foreach(foreign IN ITEMS "http:" "https:" "src=\"//" "@import" "<link")
  string(FIND "${page}" "${foreign}" place)
  if(NOT place EQUAL -1)
    message(FATAL_ERROR "${REPORT} needs more than itself: ${foreign}")
  endif()
endforeach()

# what goes wrong in the page is collected from before its first script on
set(head "<head><script>
const problems = [];
addEventListener('error', event => problems.push(event.message || 'cannot load ' + event.target.outerHTML.slice(0, 60)), true);
addEventListener('unhandledrejection', event => problems.push(String(event.reason)));
console.error = console.warn = (...words) => problems.push(words.join(' '));
</script>")
file(READ "${CMAKE_CURRENT_LIST_DIR}/browser.js" test)
string(REPLACE "<head>" "${head}" page "${page}")
if(BROKEN)
  string(REPLACE "scrub.addEventListener('input', show);" "" page "${page}")
endif()
file(WRITE "${SCRATCH}/page.html" "${page}<script>${test}</script>")

# sandboxes need rights that a build machine may not give; the page is our own
execute_process(
  COMMAND "${browser}" --headless --no-sandbox --disable-gpu --disable-dev-shm-usage --no-first-run
          --user-data-dir=${SCRATCH}/profile --window-size=${WINDOW} --virtual-time-budget=20000 --dump-dom
          "file://${SCRATCH}/page.html${place_in_film}"
  TIMEOUT 120 RESULT_VARIABLE status OUTPUT_VARIABLE dump ERROR_VARIABLE errors)
# a browser without a desktop complains of that at length
string(REGEX REPLACE "[^\n]*/dbus/[^\n]*\n" "" errors "${errors}")
if(NOT status EQUAL 0)
  message(FATAL_ERROR "${browser} ended with ${status}:\n${errors}")
endif()
if(NOT dump MATCHES "<pre>([^<]*)</pre>")
  message(FATAL_ERROR "the page did not come to the end of its test:\n${errors}")
endif()
set(found "${CMAKE_MATCH_1}")
if(BROKEN)
  if(NOT found MATCHES "expected: another picture after sliding")
    message(FATAL_ERROR "a slider that does nothing was not noticed: ${found}")
  endif()
elseif(NOT found MATCHES "^[0-9]+ checks, 0 problems")
  message(FATAL_ERROR "${found}")
endif()
message(STATUS "${found}")
