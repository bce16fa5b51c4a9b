tg_add_gpu_tests(opengl_test opengl_device.cpp tg_render_gl)
target_sources(opengl_test PRIVATE opengl_test.cpp)

add_test(NAME "opengl_test: passes as GLSL text" COMMAND opengl_test)
set_tests_properties("opengl_test: passes as GLSL text" PROPERTIES ENVIRONMENT TG_TEST_GLSL=1 TIMEOUT 600
  WORKING_DIRECTORY ${PROJECT_SOURCE_DIR})
