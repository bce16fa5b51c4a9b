tg_add_test(test_reference LIBRARIES tg_render SOURCES
  reference_cases_test.cpp reference_gradient_test.cpp shared_math_test.cpp)
