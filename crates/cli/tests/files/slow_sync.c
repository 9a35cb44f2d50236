/* A disk that is as slow as somebody wants it to be: each `fdatasync` of the program `elbowroom` says a byte on the pipe
 * ASKED, and returns when there is a byte on the pipe GO. Loaded before the C library (LD_PRELOAD). */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static int pass(const char *variable, int flags)
{
    char byte = 's';
    const char *path = getenv(variable);
    int pipe = path ? open(path, flags) : -1;
    ssize_t passed = -1;
    if (pipe >= 0) {
        do {
            passed = flags == O_WRONLY ? write(pipe, &byte, 1) : read(pipe, &byte, 1);
        } while (passed < 0 && errno == EINTR);
        close(pipe);
    }
    return passed == 1;
}

int fdatasync(int file)
{
    if (strcmp(program_invocation_short_name, "elbowroom") == 0 &&
        !(pass("ASKED", O_WRONLY) && pass("GO", O_RDONLY))) {
        errno = EIO;
        return -1;
    }
    return fsync(file);
}
