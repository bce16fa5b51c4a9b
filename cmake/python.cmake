# The Python module (docs/python.md). Sets TG_PYTHON_FOUND. TG_PYTHON: AUTO builds it where Python's headers and pybind11
# are, ON fails without them, OFF does not look.
tg_switch(TG_PYTHON OFF "Build the Python module: AUTO (where Python's headers and pybind11 are), ON, OFF" AUTO)
set(TG_PYTHON_FOUND OFF)
set(TG_PYTHON_MISSING "TG_PYTHON is OFF")

if(NOT TG_PYTHON STREQUAL OFF)
  if(TG_PYTHON STREQUAL ON)
    set(required REQUIRED)
  endif()
  find_package(Python3 ${required} COMPONENTS Interpreter Development.Module)
  set(PYBIND11_FINDPYTHON OFF)
  if(Python3_Development.Module_FOUND)  # pybind11 would end the configuration without Python
    find_package(pybind11 2.10 CONFIG ${required} QUIET)
  endif()
  if(Python3_Development.Module_FOUND AND pybind11_FOUND)
    set(TG_PYTHON_FOUND ON)
  else()
    set(TG_PYTHON_MISSING "no Python headers or no pybind11 (packages python3-dev, pybind11-dev)")
    message(STATUS "Python: not built, ${TG_PYTHON_MISSING}")
  endif()
endif()
