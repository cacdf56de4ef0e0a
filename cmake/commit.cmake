# Run at each build: cmake -DSOURCE=FOLDER -DOUT=FILE -P commit.cmake. Writes a unit that holds the commit, only where it
# differs: a new commit compiles this unit and links the program, nothing else.
cmake_minimum_required(VERSION 3.25)
set(commit "$Format:%h$")  # `git archive` puts the commit here (.gitattributes)
if(commit MATCHES "^.Format")
  set(commit "")
  find_program(GIT git)
  if(GIT AND EXISTS ${SOURCE}/.git)
    execute_process(COMMAND ${GIT} -C ${SOURCE} describe --always --abbrev=10 "--exclude=*" "--dirty=, changed"
                    OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
  endif()
endif()
if(commit)
  set(commit " (${commit})")
endif()
file(CONFIGURE OUTPUT ${OUT} CONTENT "// By cmake/commit.cmake.
extern const char* const commit_in_brackets;
const char* const commit_in_brackets = \"${commit}\";
")
