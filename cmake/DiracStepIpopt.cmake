# DiracStep::ipopt is Ipopt, an interior-point method (EPL), as plain files; there is no such target where it is not
# installed. Also used by the installed package.
if(TARGET DiracStep::ipopt)
  return()
endif()
find_path(DIRACSTEP_IPOPT_INCLUDE IpIpoptApplication.hpp PATH_SUFFIXES coin-or coin)
find_library(DIRACSTEP_IPOPT_LIBRARY ipopt)
mark_as_advanced(DIRACSTEP_IPOPT_INCLUDE DIRACSTEP_IPOPT_LIBRARY)
if(DIRACSTEP_IPOPT_INCLUDE AND DIRACSTEP_IPOPT_LIBRARY)
  add_library(DiracStep::ipopt INTERFACE IMPORTED GLOBAL)
  target_include_directories(DiracStep::ipopt SYSTEM INTERFACE ${DIRACSTEP_IPOPT_INCLUDE})
  target_link_libraries(DiracStep::ipopt INTERFACE ${DIRACSTEP_IPOPT_LIBRARY})
endif()
