# What is installed: the programs, and what a user's own contact law needs (docs/laws.md): the headers of the laws and a CMake package.
#   cmake --install build/release --prefix PREFIX [--component programs | laws | participant]
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

install(TARGETS acopla acopla-coupler acopla-dem COMPONENT programs RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
if(ACOPLA_FEM)
  install(TARGETS acopla-fem COMPONENT programs RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endif()

install(FILES ${PROJECT_SOURCE_DIR}/protocol/python/acopla.py COMPONENT programs DESTINATION ${CMAKE_INSTALL_DATADIR}/acopla/python)

# acopla::laws, the one target that a library of laws links: where the headers are, and the options of this program's own kernels. The
# instruction set must be the same, as it decides how many contacts a pack holds. Nothing is left open to the program that loads the
# library, and what two libraries call by the same name stays apart.
add_library(acopla_laws INTERFACE)
add_library(acopla::laws ALIAS acopla_laws)
set_target_properties(acopla_laws PROPERTIES EXPORT_NAME laws)
set(laws_headers ${CMAKE_INSTALL_INCLUDEDIR}/acopla)
target_include_directories(acopla_laws INTERFACE $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:${laws_headers}>)
target_compile_features(acopla_laws INTERFACE cxx_std_20)
target_compile_options(acopla_laws INTERFACE
  -fno-math-errno -fno-trapping-math $<$<NOT:$<CONFIG:Debug>>:-O3> -fvisibility=hidden $<$<CXX_COMPILER_ID:GNU>:-fno-gnu-unique>)
if(ACOPLA_MARCH STREQUAL "native")
  target_compile_options(acopla_laws INTERFACE -march=native)
endif()
target_link_options(acopla_laws INTERFACE LINKER:--no-undefined)
target_link_libraries(acopla_laws INTERFACE Eigen3::Eigen)
install(TARGETS acopla_laws EXPORT AcoplaTargets COMPONENT laws)

foreach(header
    dem/laws.h dem/kernel.h dem/particles.h dem/simd.h dem/kernels/kernel_of.h io/case_table.h io/error.h
    dem/contact/constant_torque.h dem/contact/elastic_plastic.h dem/contact/hertz.h dem/contact/kinematics.h dem/contact/linear.h
    dem/contact/linear_slider.h dem/contact/mindlin.h dem/contact/model.h dem/contact/pair_properties.h dem/contact/slider.h
    dem/contact/vector.h)
  get_filename_component(folder ${header} DIRECTORY)
  install(FILES ${PROJECT_SOURCE_DIR}/${header} DESTINATION ${laws_headers}/${folder} COMPONENT laws)
endforeach()

# acopla::participant, the C interface of the protocol (docs/guide.md). An export of its own, so that either can be installed without the other.
install(TARGETS acopla_participant EXPORT AcoplaParticipantTargets COMPONENT participant LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}
        NAMELINK_COMPONENT participant)
install(FILES ${PROJECT_SOURCE_DIR}/protocol/acopla.h COMPONENT participant DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})

set(package ${CMAKE_INSTALL_LIBDIR}/cmake/Acopla)
install(EXPORT AcoplaParticipantTargets NAMESPACE acopla:: DESTINATION ${package} COMPONENT participant)
install(EXPORT AcoplaTargets NAMESPACE acopla:: DESTINATION ${package} COMPONENT laws)
file(WRITE ${PROJECT_BINARY_DIR}/AcoplaConfig.cmake "include(CMakeFindDependencyMacro)
if(EXISTS \${CMAKE_CURRENT_LIST_DIR}/AcoplaTargets.cmake)
  find_dependency(Eigen3 3.4 NO_MODULE)
  include(\${CMAKE_CURRENT_LIST_DIR}/AcoplaTargets.cmake)
endif()
include(\${CMAKE_CURRENT_LIST_DIR}/AcoplaParticipantTargets.cmake OPTIONAL)
")
write_basic_package_version_file(${PROJECT_BINARY_DIR}/AcoplaConfigVersion.cmake COMPATIBILITY SameMinorVersion)
foreach(component laws participant)
  install(FILES ${PROJECT_BINARY_DIR}/AcoplaConfig.cmake ${PROJECT_BINARY_DIR}/AcoplaConfigVersion.cmake DESTINATION ${package} COMPONENT ${component})
endforeach()
# From the build tree too: cmake -DAcopla_DIR=build/release.
export(EXPORT AcoplaTargets NAMESPACE acopla:: FILE ${PROJECT_BINARY_DIR}/AcoplaTargets.cmake)
export(EXPORT AcoplaParticipantTargets NAMESPACE acopla:: FILE ${PROJECT_BINARY_DIR}/AcoplaParticipantTargets.cmake)
