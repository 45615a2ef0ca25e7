# Compiles SOURCE/main.cpp with nothing but what pkg-config says, and runs it.
set(ENV{PKG_CONFIG_PATH} "${PREFIX}/${LIBDIR}/pkgconfig:$ENV{PKG_CONFIG_PATH}")
execute_process(COMMAND pkg-config --cflags --libs diracstep
                OUTPUT_VARIABLE package COMMAND_ERROR_IS_FATAL ANY)
separate_arguments(package UNIX_COMMAND "${package}")
separate_arguments(FLAGS UNIX_COMMAND "${FLAGS}")
set(program ${PREFIX}/pkg_config_example)
execute_process(COMMAND ${COMPILER} -std=c++20 ${FLAGS} ${SOURCE}/main.cpp -o ${program} ${package}
                        -Wl,-rpath,${PREFIX}/${LIBDIR}
                COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${program} COMMAND_ERROR_IS_FATAL ANY)
