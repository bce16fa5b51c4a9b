tg_add_gpu_tests(test_opengl opengl_device.cpp tg_render_gl)
target_sources(test_opengl PRIVATE opengl_test.cpp)

add_test(NAME "test_opengl: passes as GLSL text" COMMAND test_opengl)
set_tests_properties("test_opengl: passes as GLSL text" PROPERTIES ENVIRONMENT TG_TEST_GLSL=1 TIMEOUT 600
  WORKING_DIRECTORY ${PROJECT_SOURCE_DIR})
