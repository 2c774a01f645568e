# cmake -DBUILD=… -DSOURCE=… -DAT=… -DGENERATOR=… -DFLAGS=… -P: installs the C interface of BUILD into a fresh prefix and builds the example in
# C11 against it, nothing else of the tree in sight.
file(REMOVE_RECURSE ${AT})
function(run)
  execute_process(COMMAND ${ARGN} COMMAND_ERROR_IS_FATAL ANY)
endfunction()
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${AT}/prefix --component participant)
file(COPY ${SOURCE}/docs/examples/c/ DESTINATION ${AT}/example)
run(${CMAKE_COMMAND} -S ${AT}/example -B ${AT}/build -G ${GENERATOR} -DCMAKE_BUILD_TYPE=Release -DCMAKE_PREFIX_PATH=${AT}/prefix -DCMAKE_C_FLAGS=${FLAGS})
run(${CMAKE_COMMAND} --build ${AT}/build)
