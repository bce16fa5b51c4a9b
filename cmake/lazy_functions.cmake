# Writes to OUT a C++ source with every function of the shared library LIBRARY whose name begins with PREFIX, for
# cmake/lazy_library.cmake. Looked up as the dynamic linker would, so what is preloaded comes first.
cmake_minimum_required(VERSION 3.24)

execute_process(COMMAND ${NM} -D --defined-only ${LIBRARY} OUTPUT_VARIABLE symbols COMMAND_ERROR_IS_FATAL ANY)
string(REGEX MATCHALL " T ${PREFIX}[A-Za-z0-9_]+" found "${symbols}")
list(TRANSFORM found REPLACE " T " "")
if(NOT found)
  message(FATAL_ERROR "${LIBRARY}: no functions found (expected some whose names begin with ${PREFIX})")
endif()

set(names "")
set(jumps "")
set(slot 0)
foreach(function IN LISTS found)
  string(APPEND names "    \"${function}\",\n")
  string(APPEND jumps "TG_JUMP(${function}, ${slot})\n")
  math(EXPR slot "${slot} + 8")
endforeach()
file(WRITE "${OUT}" "// Made by cmake/lazy_functions.cmake.
#include <dlfcn.h>

#include <cstddef>

// Where each function is, from the start of the program on.
extern \"C\" {
extern void* tg_lazy_${PREFIX}[];
[[gnu::visibility(\"hidden\")]] void* tg_lazy_${PREFIX}[${slot} / 8];
}

namespace {

constexpr const char* kNames[] = {
${names}};

long absent() { return ${VALUE}; }

[[gnu::constructor]] void load() {
  const bool there = dlopen(\"${NAME}\", RTLD_NOW | RTLD_GLOBAL) != nullptr;
  for (std::size_t i = 0; i < sizeof(kNames) / sizeof(*kNames); ++i) {
    void* function = there ? dlsym(RTLD_DEFAULT, kNames[i]) : nullptr;
    tg_lazy_${PREFIX}[i] = function ? function : reinterpret_cast<void*>(&absent);
  }
}

}  // namespace

#if defined(__x86_64__)
#define TG_JUMP_TO(slot) \"endbr64\\njmp *tg_lazy_${PREFIX}+\" #slot \"(%rip)\\n\"
#else
#define TG_JUMP_TO(slot)                        \\
  \"bti c\\nadrp x16, tg_lazy_${PREFIX}+\" #slot \"\\n\" \\
  \"ldr x16, [x16, :lo12:tg_lazy_${PREFIX}+\" #slot \"]\\nbr x16\\n\"
#endif
#define TG_JUMP(name, slot)                                                          \\
  asm(\".text\\n.globl \" #name \"\\n.hidden \" #name \"\\n.type \" #name \", @function\\n\" #name \":\\n\" \\
      TG_JUMP_TO(slot) \".size \" #name \", . - \" #name \"\\n\");

${jumps}")
