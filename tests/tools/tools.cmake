# SPDX-License-Identifier: MIT
# Runs TOOL as CASE says, in an empty folder SCRATCH.
cmake_minimum_required(VERSION 3.22)

file(REMOVE_RECURSE "${SCRATCH}")
file(MAKE_DIRECTORY "${SCRATCH}")

# run(STATUS ARGUMENTS...): the tool has to end with that exit status; its output is left in `output`.
function(run status)
  execute_process(COMMAND "${TOOL}" ${ARGN} WORKING_DIRECTORY "${SCRATCH}" RESULT_VARIABLE result
                  OUTPUT_VARIABLE output ERROR_VARIABLE errors)
  if(NOT result STREQUAL status)
    message(FATAL_ERROR "exit status ${result} instead of ${status}:\n${output}\n${errors}")
  endif()
  set(output "${output}" PARENT_SCOPE)
  set(errors "${errors}" PARENT_SCOPE)
endfunction()

# record(ARGUMENTS...): makes the recording `pour` in SCRATCH.
function(record)
  execute_process(COMMAND "${RECORD}" ${ARGN} --out pour WORKING_DIRECTORY "${SCRATCH}" RESULT_VARIABLE result
                  OUTPUT_VARIABLE output ERROR_VARIABLE errors)
  if(NOT result EQUAL 0)
    message(FATAL_ERROR "record_pour failed: ${output}\n${errors}")
  endif()
endfunction()

# A refusal is one line that names what is wrong.
function(expect_one_line text part)
  string(STRIP "${text}" text)
  if(text MATCHES "\n" OR NOT text MATCHES "${part}")
    message(FATAL_ERROR "expected one line that names ${part}, got:\n${text}")
  endif()
endfunction()

function(expect_keys file)
  file(READ "${file}" json)
  foreach(key IN LISTS ARGN)
    string(REPLACE "." ";" path "${key}")
    string(JSON type ERROR_VARIABLE problem TYPE "${json}" ${path})
    if(problem)
      message(FATAL_ERROR "${file} has no ${key}: ${problem}")
    endif()
  endforeach()
endfunction()

set(scene_head "{\"format\": \"decant-scene\", \"version\": 1, \"name\": \"drop\", \"record_hz\": 100")
set(scene_tail "\"bodies\": [{\"name\": \"box\", \"shape\": {\"box_inside\": {\"min_m\": [0, 0, 0], \"max_m\": [0.1, 0.05, 0.1]}, \"open\": \"+z\"}}],
  \"fluid\": [{\"box\": {\"min_m\": [0, 0, 0], \"max_m\": [0.05, 0.05, 0.05]}}], \"gauges\": [\"front_mm\", \"volume_ml@box\"]}")

if(CASE STREQUAL "simulate_runs_a_scene")
  file(WRITE "${SCRATCH}/scene.json" "${scene_head}, \"spacing_m\": 0.01, \"end_s\": 0.1, ${scene_tail}")
  run(0 scene.json --json out.json --report out.html --vtk vtk)
  expect_keys("${SCRATCH}/out.json" series series.t_s series.front_mm series.volume_ml@box particles lost spilled
              sub_steps iterations density_error_max volume_ml peak_rss_mb wall_s threads status)
  file(READ "${SCRATCH}/out.json" json)
  string(JSON status GET "${json}" status)
  string(JSON particles GET "${json}" particles)
  string(JSON lost GET "${json}" lost)
  string(JSON times LENGTH "${json}" series t_s)
  string(JSON last GET "${json}" series t_s 10)
  if(NOT status STREQUAL ok OR NOT particles EQUAL 125 OR NOT lost EQUAL 0 OR NOT times EQUAL 11
     OR NOT last MATCHES "^(0\\.1|0\\.0999|0\\.1000)")
    message(FATAL_ERROR "status ${status}, ${particles} particles, ${lost} lost, ${times} times up to ${last}")
  endif()
  foreach(file IN ITEMS out.html vtk/all.pvd)
    if(NOT EXISTS "${SCRATCH}/${file}")
      message(FATAL_ERROR "no ${file} was written")
    endif()
  endforeach()

elseif(CASE STREQUAL "simulate_warns_about_a_mesh")
  # a tray of paper, without thickness
  file(WRITE "${SCRATCH}/tray.obj" "v 0 0 0\nv 0.1 0 0\nv 0.1 0.05 0\nv 0 0.05 0\nv 0 0 0.05\nv 0.1 0 0.05\nv 0.1 0.05 0.05\n"
       "v 0 0.05 0.05\nf 1 4 3 2\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n")
  file(WRITE "${SCRATCH}/scene.json" "${scene_head}, \"spacing_m\": 0.01, \"end_s\": 0.05,
  \"bodies\": [{\"name\": \"tray\", \"shape\": {\"mesh\": \"tray.obj\"}}],
  \"fluid\": [{\"box\": {\"min_m\": [0.01, 0.01, 0.01], \"max_m\": [0.05, 0.04, 0.04]}}], \"gauges\": [\"volume_ml@tray\"]}")
  run(0 scene.json --json out.json --report out.html)
  if(NOT errors MATCHES "warning: body 'tray': surface is open: 4 open edges in 1 loop")
    message(FATAL_ERROR "no warning of an open mesh:\n${errors}")
  endif()
  file(READ "${SCRATCH}/out.html" report)
  if(NOT report MATCHES "surface is open: 4 open edges")
    message(FATAL_ERROR "the report does not say that the mesh is open")
  endif()

elseif(CASE STREQUAL "simulate_refuses_a_bad_scene")
  run(2 missing.json --json out.json)
  expect_one_line("${errors}" "missing.json")
  file(WRITE "${SCRATCH}/scene.json" "${scene_head}, \"spacing_m\": -0.01, \"end_s\": 0.1, ${scene_tail}")
  run(2 scene.json --json out.json)
  expect_one_line("${errors}" "spacing_m.*-0.01")
  file(WRITE "${SCRATCH}/scene.json" "${scene_head}, \"spacing_m\": 0.01")
  run(2 scene.json --json out.json)
  expect_one_line("${errors}" "scene.json")
  file(WRITE "${SCRATCH}/scene.json" "${scene_head}, \"spacing_m\": 0.01, \"end_s\": 0.1, \"endd_s\": 1, ${scene_tail}")
  run(2 scene.json --json out.json)
  expect_one_line("${errors}" "endd_s")

elseif(CASE STREQUAL "replay_motion_reports")
  set(motion TRD_2D_0.3m_2.4s_270deg)
  # a coarse and short run: that it works; how well it agrees with the measurement is for the physics tests
  run(0 --poses "${SOURCE}/examples/data/pose_${motion}.csv" --heights "${SOURCE}/examples/data/height_${motion}.csv"
      --radius-mm 49 --depth-mm 78 --spacing-mm 10 --decay-s 1 --json out.json --report out.html)
  expect_keys("${SCRATCH}/out.json" peak_mm measured_peak_mm correlation time_shift_s decay_frequency_hz
              measured_frequency_hz damping_ratio lost wall_s series.t_s series.height_mm)
  if(NOT EXISTS "${SCRATCH}/out.html" OR NOT output MATCHES "out.html")
    message(FATAL_ERROR "the report is missing, or the output does not say where it is:\n${output}")
  endif()

elseif(CASE STREQUAL "replay_motion_refuses_a_missing_file")
  run(2 --poses missing.csv --heights missing.csv --radius-mm 49 --depth-mm 78 --json out.json)
  expect_one_line("${errors}" "missing.csv")

elseif(CASE STREQUAL "slosh_all_motions_sums_up")
  # a program in place of replay_motion that knows its answers, and writes down that it was called
  file(WRITE "${SCRATCH}/replay" "#!/usr/bin/env bash
while (($# > 0)); do
  case $1 in --poses) poses=$2 ;; --json) json=$2 ;; esac
  shift
done
case $poses in *pose_LE*) peak=12 ;; *pose_Tilt*) peak=7 ;; *) peak=9 ;; esac
if [[ $poses == *broken* ]]; then peak=null; fi
echo run >>calls
printf '{\\n \"correlation\": 0.9%s,\\n' \"$peak\" >\"$json\"
for key in time_shift_s decay_frequency_hz measured_frequency_hz damping_ratio measured_damping_ratio particles lost wall_s; do
  printf ' \"%s\": 3,\\n' $key >>\"$json\"
done
printf ' \"measured_peak_mm\": 10.0,\\n \"peak_mm\": %s\\n}\\n' $peak >>\"$json\"
")
  file(CHMOD "${SCRATCH}/replay" PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE)
  set(ENV{DECANT_REPLAY_MOTION} "${SCRATCH}/replay")
  set(TOOL "${SOURCE}/benchmarks/slosh_all_motions.sh")
  foreach(round IN ITEMS first second)  # the second finds all results
    run(0 "${SOURCE}/examples/data" 6 results)
    foreach(line IN ITEMS "LE_2D_0m_5s_900deg,no,12.0,10.0,[+]20.0" "Tilt_TRD_2D_0.3m_3.5s_30deg,yes,7.0,10.0,-30.0"
            "all: 3 motions at 6 mm, peak off by 20.0 % in the median and 30.0 % at worst, correlation 0.970 in the median and 0.912"
            "upright: 2 motions at 6 mm, peak off by 15.0 % in the median and 20.0 % at worst, correlation 0.951 in the median and 0.912")
      if(NOT output MATCHES "${line}")
        message(FATAL_ERROR "no line '${line}' in the ${round} run:\n${output}")
      endif()
    endforeach()
  endforeach()
  file(STRINGS "${SCRATCH}/calls" calls)
  list(LENGTH calls count)
  if(NOT count EQUAL 3)
    message(FATAL_ERROR "three motions were replayed ${count} times")
  endif()
  file(WRITE "${SCRATCH}/broken/pose_broken.csv" "")
  run(1 "${SCRATCH}/broken" 6 results)
  expect_one_line("${errors}" "broken.*peak_mm")
  run(2 "${SCRATCH}/nowhere" 6 results)
  expect_one_line("${errors}" "nowhere")

elseif(CASE STREQUAL "track_scores_a_recording")
  # coarse, 90 % full and short: that both tools work together; how well it tracks is for the benchmark
  record(--container cup --fill 0.9 --seed 3 --spacing-mm 7 --seconds 1.6)
  run(0 pour --corrector open_loop,map_filter,warp_field,default --spacing-mm 8 --json out.json --report out.html)
  foreach(name IN ITEMS open_loop map_filter warp_field default)
    expect_keys("${SCRATCH}/out.json" correctors.${name}.iou_mean correctors.${name}.iou_pooled
                correctors.${name}.prior_iou correctors.${name}.forecast_iou correctors.${name}.log_likelihood
                correctors.${name}.volume_ml.cup correctors.${name}.volume_ml.pan
                correctors.${name}.frames_per_second correctors.${name}.status)
  endforeach()
  file(READ "${SCRATCH}/out.json" json)
  string(JSON frames LENGTH "${json}" correctors default iou)
  string(JSON open GET "${json}" correctors open_loop iou_mean)
  string(JSON closed GET "${json}" correctors default iou_mean)
  if(NOT frames EQUAL 48 OR NOT closed GREATER open)
    message(FATAL_ERROR "${frames} frames; open loop ${open}, default ${closed}")
  endif()
  file(SIZE "${SCRATCH}/out.html" bytes)
  if(bytes LESS 100000 OR bytes GREATER 8000000)
    message(FATAL_ERROR "the report has ${bytes} bytes")
  endif()

elseif(CASE STREQUAL "track_estimates_what_it_is_not_told")
  # coarse and short, nothing hidden, and told the right amount: the estimate may not lead away from it
  record(--container cup --fill 0.6 --seed 3 --spacing-mm 7 --seconds 1.8 --nothing-hidden)
  run(0 pour --corrector default_adapting,default_amounts --spacing-mm 8 --no-forecasts --json out.json)
  if(NOT output MATCHES "at first [0-9]+ ml" OR NOT output MATCHES "pose_delay_s")
    message(FATAL_ERROR "the estimates are not told:\n${output}")
  endif()
  file(READ "${SCRATCH}/out.json" json)
  foreach(parameter IN ITEMS pull_x_m_s2 pull_y_m_s2 drag_1_s viscosity_decades pose_delay_s)
    string(JSON found TYPE "${json}" correctors default_adapting parameters ${parameter})
    if(NOT found STREQUAL "NUMBER")
      message(FATAL_ERROR "${parameter} is ${found}")
    endif()
  endforeach()
  file(READ "${SCRATCH}/pour/recording.json" recording)
  string(JSON true_ml GET "${recording}" truth initial_ml)
  string(JSON low_ml GET "${json}" correctors default_amounts initial_ml low_90)
  string(JSON high_ml GET "${json}" correctors default_amounts initial_ml high_90)
  if(NOT low_ml LESS true_ml OR NOT true_ml LESS high_ml)
    message(FATAL_ERROR "${true_ml} ml is not within ${low_ml} .. ${high_ml} ml")
  endif()

elseif(CASE STREQUAL "track_refuses_a_bad_recording")
  run(2 missing --json out.json)
  expect_one_line("${errors}" "missing")
  file(MAKE_DIRECTORY "${SCRATCH}/bad")
  file(WRITE "${SCRATCH}/bad/recording.json" "{\"format\": \"decant-recording\", \"version\": 7}")
  run(2 bad --json out.json)
  expect_one_line("${errors}" "version")
  # a lens that zooms
  file(COPY "${SOURCE}/examples/data/pour_cup" DESTINATION "${SCRATCH}")
  file(READ "${SCRATCH}/pour_cup/scene_camera.json" fixed)
  string(JSON rotation GET "${fixed}" 0 cam_R_w2c)
  string(JSON translation GET "${fixed}" 0 cam_t_w2c)
  set(at "\"cam_R_w2c\": ${rotation}, \"cam_t_w2c\": ${translation}, \"depth_scale\": 1.0")
  set(views "\"0\": {\"cam_K\": [600, 0, 319.5, 0, 600, 239.5, 0, 0, 1], ${at}}")
  foreach(frame RANGE 1 83)
    string(APPEND views ", \"${frame}\": {\"cam_K\": [61${frame}, 0, 319.5, 0, 600, 239.5, 0, 0, 1], ${at}}")
  endforeach()
  file(WRITE "${SCRATCH}/pour_cup/scene_camera.json" "{${views}}")
  run(2 pour_cup --json out.json)
  expect_one_line("${errors}" "the same in every frame")

elseif(CASE STREQUAL "estimate_fill_is_not_told_the_amount")
  record(--container cup --fill 0.6 --seed 3 --spacing-mm 7 --seconds 1.8 --nothing-hidden)
  # what the recording says of the amount is a lie, and the truth is away
  file(READ "${SCRATCH}/pour/recording.json" recording)
  string(JSON true_ml GET "${recording}" truth initial_ml)
  string(JSON recording SET "${recording}" liquid initial fill_fraction 0.1)
  string(JSON recording REMOVE "${recording}" truth)
  file(WRITE "${SCRATCH}/pour/recording.json" "${recording}")
  run(0 pour --methods open_loop,default --levels 0,30,60,90 --grid-step 20 --spacing-mm 8 --json out.json
      --report out.html)
  expect_keys("${SCRATCH}/out.json" posterior.open_loop.0 posterior.default.none_of_these posterior_over_time.default.60
              container_ml volume_ml interval_90_ml none_of_these seconds)
  file(READ "${SCRATCH}/out.json" json)
  foreach(method IN ITEMS open_loop default)
    string(JSON probability GET "${json}" posterior ${method} 60)
    string(JSON level GET "${json}" most_probable_percent ${method})
    if(NOT probability GREATER 0.8 OR NOT level EQUAL 60)
      message(FATAL_ERROR "${method}: ${level} % is the most probable, 60 % has ${probability}")
    endif()
  endforeach()
  string(JSON low_ml GET "${json}" interval_90_ml 0)
  string(JSON high_ml GET "${json}" interval_90_ml 1)
  string(JSON container_ml GET "${json}" container_ml)
  if(NOT low_ml LESS true_ml OR NOT true_ml LESS high_ml OR NOT high_ml LESS container_ml)
    message(FATAL_ERROR "${true_ml} ml is not within ${low_ml} .. ${high_ml} ml of ${container_ml} ml")
  endif()
  file(READ "${SCRATCH}/out.html" report)
  if(NOT report MATCHES "Over time: default" OR NOT report MATCHES "<svg class=\"chart")
    message(FATAL_ERROR "the report has no chart of the posterior")
  endif()

elseif(CASE STREQUAL "estimate_fill_refuses")
  run(2 missing --json out.json)
  expect_one_line("${errors}" "missing")
  run(2 "${SOURCE}/examples/data/pour_cup" --methods magic)
  expect_one_line("${errors}" "--methods.*magic")
  run(2 "${SOURCE}/examples/data/pour_cup" --levels 30,130)
  expect_one_line("${errors}" "--levels.*130")
  run(2 "${SOURCE}/examples/data/pour_cup" --json nowhere/out.json)
  expect_one_line("${errors}" "nowhere/out.json")
  # no body that liquid could start in
  file(COPY "${SOURCE}/examples/data/pour_cup" DESTINATION "${SCRATCH}")
  file(READ "${SCRATCH}/pour_cup/recording.json" recording)
  string(JSON recording REMOVE "${recording}" liquid initial)
  string(JSON recording SET "${recording}" bodies 0 role "\"obstacle\"")
  file(WRITE "${SCRATCH}/pour_cup/recording.json" "${recording}")
  run(2 pour_cup)
  expect_one_line("${errors}" "no container.*source")

elseif(CASE STREQUAL "tracking_experiment_scores_and_resumes")
  # as small as it goes: that figures arrive where they should; what they are is for the experiment itself
  set(small --only cup_90_5 --seconds 0.8 --spacing-mm 10 --model-spacing-mm 12)
  file(WRITE "${SCRATCH}/all/unfinished/cup_90_5/recording.json" "of a run that was stopped")
  run(0 all ${small} --corrector open_loop,default --threads 1 --json first.json --report out.html)
  file(READ "${SCRATCH}/first.json" first)
  if(NOT output MATCHES "1 of 1 recordings made, 4 of 4 results computed" OR EXISTS "${SCRATCH}/all/unfinished")
    message(FATAL_ERROR "the first run did not make its recording and four results:\n${output}")
  endif()
  foreach(key IN ITEMS truth_iou_mean truth_prior_iou pixels true_volume_ml settings)
    string(JSON found GET "${first}" results cup_90_5.default ${key})
  endforeach()
  foreach(pair IN ITEMS iou_mean,truth_iou_mean prior_iou,truth_prior_iou)
    string(REPLACE "," ";" pair "${pair}")
    list(GET pair 0 key)
    string(JSON perfect GET "${first}" results cup_90_5.perfect_state ${key})
    string(JSON closed GET "${first}" results cup_90_5.default ${key})
    if(NOT perfect GREATER closed)
      message(FATAL_ERROR "${key}: the true state has ${perfect}, the default ${closed}")
    endif()
  endforeach()
  # knowing that poses are late helps
  string(JSON told GET "${first}" results cup_90_5.true_effects iou_mean)
  string(JSON untold GET "${first}" results cup_90_5.open_loop iou_mean)
  if(NOT told GREATER untold)
    message(FATAL_ERROR "with the true effects the model has ${told}, without them ${untold}")
  endif()
  string(JSON title GET "${first}" tables 0 title)
  string(JSON overall GET "${first}" tables 0 figures open_loop overall)
  string(JSON bottle TYPE "${first}" tables 0 figures open_loop bottle)

  # the same recording by the other tool
  execute_process(COMMAND "${TRACK}" all/cup_90_5 --corrector open_loop --spacing-mm 12 --threads 1 --json track.json
                  WORKING_DIRECTORY "${SCRATCH}" RESULT_VARIABLE result OUTPUT_VARIABLE track_output
                  ERROR_VARIABLE errors)
  if(NOT result EQUAL 0)
    message(FATAL_ERROR "track failed: ${track_output}\n${errors}")
  endif()
  file(READ "${SCRATCH}/track.json" tracked)
  foreach(key IN ITEMS particles status)
    string(JSON here GET "${first}" results cup_90_5.open_loop ${key})
    string(JSON there GET "${tracked}" correctors open_loop ${key})
    if(NOT here STREQUAL there)
      message(FATAL_ERROR "open_loop's ${key} is ${here}, by track ${there}")
    endif()
  endforeach()
  # Not to the bit: a compiler may fuse other products and sums where it inlines other calls, and splashes are chaotic. A
  # frame that is counted twice, a wrong spacing or a prior for a posterior would show.
  foreach(key IN ITEMS iou_mean iou_pooled prior_iou)
    string(JSON here GET "${first}" results cup_90_5.open_loop ${key})
    string(JSON there GET "${tracked}" correctors open_loop ${key})
    execute_process(COMMAND awk "BEGIN { exit !((${here} - ${there}) ^ 2 < 0.02 ^ 2) }" RESULT_VARIABLE differs)
    if(NOT differs EQUAL 0)
      message(FATAL_ERROR "open_loop's ${key} is ${here}, by track ${there}")
    endif()
  endforeach()
  string(JSON mean GET "${tracked}" correctors open_loop iou_mean)
  if(NOT title STREQUAL "Assimilated" OR NOT bottle STREQUAL "NULL" OR NOT overall GREATER mean)
    message(FATAL_ERROR "table ${title}: overall ${overall} for a mean of ${mean}, bottle ${bottle}")
  endif()

  # a second run finds all, and writes no result anew
  file(TIMESTAMP "${SCRATCH}/all/results/cup_90_5.default.json" before "%s")
  run(0 all ${small} --corrector open_loop,default --json second.json)
  file(TIMESTAMP "${SCRATCH}/all/results/cup_90_5.default.json" after "%s")
  file(READ "${SCRATCH}/second.json" second)
  string(JSON first_results GET "${first}" results)
  string(JSON second_results GET "${second}" results)
  if(NOT output MATCHES "0 of 1 recordings made, 0 of 4 results computed" OR NOT before EQUAL after
     OR NOT first_results STREQUAL second_results)
    message(FATAL_ERROR "the second run computed again:\n${output}")
  endif()

  # two runs side by side; what is late breaks nothing
  run(0 all ${small} --set sweep --condition late --threads 2 --json sweep.json --report out.html)
  if(NOT output MATCHES "0 of 1 recordings made, 3 of 5 results computed")
    message(FATAL_ERROR "a sweep of three values did not compute three results:\n${output}")
  endif()
  file(READ "${SCRATCH}/sweep.json" sweep)
  string(JSON unaltered GET "${sweep}" tables 1 figures default 0 assimilated)
  string(JSON late GET "${sweep}" tables 1 figures default 4 assimilated)
  string(JSON breaking TYPE "${sweep}" tables 0 figures late default assimilated)  # null where there is none
  if(NOT unaltered GREATER late)
    message(FATAL_ERROR "masks that are 4 frames late have ${late}, others ${unaltered}")
  endif()
  file(READ "${SCRATCH}/out.html" report)
  if(NOT report MATCHES "Masks come late" OR NOT report MATCHES "<svg class=\"chart")
    message(FATAL_ERROR "the report has no chart of late masks")
  endif()

elseif(CASE STREQUAL "tracking_experiment_refuses")
  run(2 all --set everything)
  expect_one_line("${errors}" "--set.*everything.*sweep")
  run(2 all --corrector magic)
  expect_one_line("${errors}" "--corrector.*magic")
  run(2 all --only cup_31_1)
  expect_one_line("${errors}" "--only.*cup_31_1")
  file(WRITE "${SCRATCH}/file" "")
  run(2 file --only cup_90_5)
  expect_one_line("${errors}" "file.*cannot be made")
  run(2 all --json nowhere/out.json)
  expect_one_line("${errors}" "nowhere/out.json")
  # a folder in which only the recordings cannot be made
  file(WRITE "${SCRATCH}/blocked/unfinished" "")
  run(2 blocked --only cup_90_5)
  expect_one_line("${errors}" "blocked/unfinished.*cannot be made")
  # a recording that is none
  file(MAKE_DIRECTORY "${SCRATCH}/other/cup_90_5")
  run(2 other --only cup_90_5)
  expect_one_line("${errors}" "cup_90_5/recording.json")

else()
  message(FATAL_ERROR "no case '${CASE}'")
endif()
