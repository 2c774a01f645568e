# cmake -DBUILD=… -DSOURCE=… -DAT=… -DGENERATOR=… -DCOMPILER=… -DLAUNCHER=… -DFLAGS=… -P: installs the laws of BUILD into a fresh prefix and
# builds the libraries of tests/plugins and the example of the docs against it, nothing else of the tree in sight.
file(REMOVE_RECURSE ${AT}/prefix ${AT}/build)
file(REMOVE_RECURSE ${AT}/example)
file(COPY ${SOURCE}/docs/examples/law/ DESTINATION ${AT}/example)
file(COPY ${SOURCE}/tests/plugins/ DESTINATION ${AT}/libraries)
function(run)
  execute_process(COMMAND ${ARGN} COMMAND_ERROR_IS_FATAL ANY)
endfunction()
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${AT}/prefix --component laws)
run(${CMAKE_COMMAND} -S ${AT}/libraries/outside -B ${AT}/build -G ${GENERATOR} -DCMAKE_BUILD_TYPE=Release -DCMAKE_PREFIX_PATH=${AT}/prefix
    -DEXAMPLE=${AT}/example -DLIBRARIES=${AT}/libraries -DCMAKE_CXX_COMPILER=${COMPILER} -DCMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER}
    -DCMAKE_CXX_FLAGS=${FLAGS})
run(${CMAKE_COMMAND} --build ${AT}/build)
file(COPY ${AT}/build/libwalton_braun.so DESTINATION ${AT}/example/build)
