# Installs BUILD into an empty folder and moves the tree to PREFIX: no path to where it was made may be needed.
file(REMOVE_RECURSE ${PREFIX} ${PREFIX}_as_installed)
execute_process(COMMAND ${CMAKE_COMMAND} --install ${BUILD} --config ${CONFIG} --prefix ${PREFIX}_as_installed
                COMMAND_ERROR_IS_FATAL ANY)
file(RENAME ${PREFIX}_as_installed ${PREFIX})

file(GLOB_RECURSE files ${PREFIX}/*.cmake ${PREFIX}/*.pc ${PREFIX}/*.h ${PREFIX}/*.hpp)
foreach(file IN LISTS files)
  file(READ ${file} text)
  foreach(path ${PREFIX} ${BUILD})
    string(FIND "${text}" "${path}" place)
    if(NOT place EQUAL -1)
      message(FATAL_ERROR "${file} names ${path}; the installed tree must work anywhere")
    endif()
  endforeach()
endforeach()
