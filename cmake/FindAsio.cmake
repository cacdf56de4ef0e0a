# Debian's libasio-dev is headers alone and ships no CMake configuration.
find_path(Asio_INCLUDE_DIR asio.hpp)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(Asio REQUIRED_VARS Asio_INCLUDE_DIR)
if(Asio_FOUND AND NOT TARGET Asio::asio)
  find_package(Threads REQUIRED)
  add_library(Asio::asio INTERFACE IMPORTED)
  target_include_directories(Asio::asio SYSTEM INTERFACE ${Asio_INCLUDE_DIR})
  # Debian's asio knows the coroutines of C++20 in GCC only.
  target_compile_definitions(Asio::asio INTERFACE ASIO_STANDALONE
                             $<$<CXX_COMPILER_ID:Clang>:ASIO_HAS_CO_AWAIT;ASIO_HAS_STD_COROUTINE>)
  target_link_libraries(Asio::asio INTERFACE Threads::Threads)
endif()
