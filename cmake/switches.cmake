# The switches of the build (docs/packages.md has them all).

# tg_switch(NAME DEFAULT HELP [WORD...]): an entry of the cache that is ON, OFF or one of the words. CMake's other names of
# ON and OFF, in any case, become these; anything else is refused.
function(tg_switch name default help)
  set(choices ${ARGN} ON OFF)
  if(ARGN)
    set(${name} ${default} CACHE STRING "${help}")
    set_property(CACHE ${name} PROPERTY STRINGS ${choices})
  else()
    set(${name} ${default} CACHE BOOL "${help}")
  endif()
  string(TOUPPER "${${name}}" value)
  if(value MATCHES "^(ON|YES|TRUE|Y|[+-]?[0-9]*[1-9][0-9]*)$")
    set(value ON)
  elseif(value MATCHES "^(OFF|NO|FALSE|N|IGNORE|(.*-)?NOTFOUND|[+-]?0+|)$")
    set(value OFF)
  elseif(NOT value IN_LIST choices)
    list(JOIN choices ", " words)
    message(FATAL_ERROR "${name}: no such choice (expected ${words}, found \"${${name}}\")")
  endif()
  set(${name} ${value} PARENT_SCOPE)
endfunction()
