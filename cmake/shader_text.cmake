# Preprocesses the shader SOURCE and writes it to OUT as `const char NAME[]`: plain GLSL 4.50, without what only
# glslang's front end knows.
execute_process(COMMAND ${GLSLANG} -E -I${INCLUDE} ${SOURCE} OUTPUT_VARIABLE text RESULT_VARIABLE failed)
if(failed)
  message(FATAL_ERROR "${SOURCE}: ${text}")
endif()
string(REGEX REPLACE "#line[^\n]*" "" text "${text}")
string(REGEX REPLACE "#extension GL_(GOOGLE_include_directive|EXT_control_flow_attributes)[^\n]*" "" text "${text}")
string(REPLACE "[[unroll]]" "" text "${text}")
string(REGEX REPLACE "\n[ \n]*\n" "\n" text "${text}")
file(WRITE ${OUT} "const char ${NAME}[] = R\"glsl(${text})glsl\";\n")
