/* Loaded before the libraries of MPICH (LD_PRELOAD), whose ranks otherwise never give way while they wait: then
   tests with more ranks than cores would take minutes, most of it in HDF5. UCX moves MPICH's messages. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <sched.h>

unsigned ucp_worker_progress(void *worker) {
    static unsigned (*progress)(void *);
    if (!progress) progress = (unsigned (*)(void *))dlsym(RTLD_NEXT, "ucp_worker_progress");
    unsigned moved = progress(worker);
    if (!moved) sched_yield();
    return moved;
}
