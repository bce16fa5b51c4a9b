add_library(tg_goldens STATIC ${CMAKE_SOURCE_DIR}/tests/goldens/goldens.cpp)
target_link_libraries(tg_goldens PUBLIC tg_render tg_test_support)
target_compile_definitions(tg_goldens PUBLIC TG_GOLDENS="${CMAKE_SOURCE_DIR}/tests/goldens")

# The one command that renders the golden frames anew.
add_executable(tg_make_goldens ${CMAKE_SOURCE_DIR}/tests/goldens/make_goldens.cpp)
target_link_libraries(tg_make_goldens PRIVATE tg_goldens)

tg_add_test(test_reference LIBRARIES tg_render tg_goldens SOURCES
  golden_test.cpp reference_cases_test.cpp reference_gradient_test.cpp shared_math_test.cpp)
