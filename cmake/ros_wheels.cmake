# For builds against the ROS 2 wheels from PyPI: -DCMAKE_PROJECT_INCLUDE=<this file>.
#
# When CMakeLists.txt is through and all targets are known, put right the include directories in
# their interfaces, which CMake checks when it generates:
#
# - Targets that come with the wheels name directories of the machine on which the wheels were
#   made (/opt/python/cp311-cp311/...). Those that are not here are dropped; Python's and NumPy's
#   own are found by rosidl_generator_py anyway.
# - Our own exported target names NumPy's directory, and CMake refuses to export one below the
#   source tree, where the virtual environment is (.venv/). It is kept for the build alone.
function(_repair_include_directories)
  get_property(imported DIRECTORY PROPERTY IMPORTED_TARGETS)
  get_property(built DIRECTORY PROPERTY BUILDSYSTEM_TARGETS)
  foreach(target IN LISTS imported built)
    get_target_property(directories "${target}" INTERFACE_INCLUDE_DIRECTORIES)
    if(NOT directories)
      continue()
    endif()
    set(kept "")
    foreach(directory IN LISTS directories)
      if(NOT IS_ABSOLUTE "${directory}")
        list(APPEND kept "${directory}")
      elseif(NOT EXISTS "${directory}")
        continue()
      elseif(target IN_LIST built)
        list(APPEND kept "$<BUILD_INTERFACE:${directory}>")
      else()
        list(APPEND kept "${directory}")
      endif()
    endforeach()
    set_property(TARGET "${target}" PROPERTY INTERFACE_INCLUDE_DIRECTORIES "${kept}")
  endforeach()
endfunction()

cmake_language(DEFER CALL _repair_include_directories)
