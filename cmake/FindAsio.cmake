# Debian's libasio-dev is headers alone and ships no CMake configuration.
find_path(Asio_INCLUDE_DIR asio.hpp)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(Asio REQUIRED_VARS Asio_INCLUDE_DIR)
if(Asio_FOUND AND NOT TARGET Asio::asio)
  find_package(Threads REQUIRED)
  add_library(Asio::asio INTERFACE IMPORTED)
  target_include_directories(Asio::asio SYSTEM INTERFACE ${Asio_INCLUDE_DIR})
  # A coroutine resumes on another thread, and Clang 16 can keep a thread_local's address over its suspension: asio's
  # memory of one thread was then used by two. Debian's asio knows the coroutines of C++20 in GCC only.
  target_compile_definitions(Asio::asio INTERFACE ASIO_STANDALONE ASIO_DISABLE_THREAD_KEYWORD_EXTENSION
                             $<$<CXX_COMPILER_ID:Clang>:ASIO_HAS_CO_AWAIT;ASIO_HAS_STD_COROUTINE>)
  target_link_libraries(Asio::asio INTERFACE Threads::Threads)
endif()
