#!/usr/bin/env python3
"""Shows a folder at another place as a slow file server would: every call takes a while, files cannot be mapped to be written, there
may be no locks, and a file's size and times are asked for again after a second.  One call may fail, or be done and reported as failed,
as a request that is sent twice is.

  remote_folder.py FOLDER PLACE [--delay-ms MS] [--no-locks] [--fail KIND:NUMBER:ERRNO] [--lost KIND:NUMBER:ERRNO] [--counts FILE]

KIND is a call of it (write, flush, fsync, rename, create, open, read, unlink, mkdir), NUMBER counts those from 1 on, ERRNO is a name
(EIO).  A flush is what closing a file sends: an error of writing may come with it, and not before.  Runs until PLACE is unmounted,
then writes how many calls of each kind there were."""
import argparse
import collections
import errno
import json
import os
import threading
import time

import fusepy


class RemoteFolder(fusepy.Operations):
    def __init__(self, folder, arguments):
        self.folder = os.path.realpath(folder)
        self.delay_s = arguments.delay_ms / 1000
        self.no_locks = arguments.no_locks
        self.counts_path = arguments.counts
        self.faults = {}  # (kind, number): errno, whether it is done
        for words, is_done in ((arguments.fail, False), (arguments.lost, True)):
            if words:
                kind, number, name = words.split(":")
                self.faults[kind, int(number)] = getattr(errno, name), is_done
        self.counts = collections.Counter()
        self.lock_of_counts = threading.Lock()

    def __call__(self, operation, path, *arguments):
        time.sleep(self.delay_s)
        with self.lock_of_counts:
            self.counts[operation] += 1
            fault, is_done = self.faults.get((operation, self.counts[operation]), (0, False))
        if fault and not is_done:
            raise fusepy.FuseOSError(fault)
        if not hasattr(self, operation):
            raise fusepy.FuseOSError(errno.ENOSYS)
        result = getattr(self, operation)(self.folder + path if path else None, *arguments)
        if fault:
            raise fusepy.FuseOSError(fault)
        return result

    def init(self, path):
        pass

    def destroy(self, path):
        if self.counts_path:
            with open(self.counts_path, "w") as file:
                json.dump(self.counts, file)

    def getattr(self, path, handle=None):
        found = os.fstat(handle) if handle is not None else os.lstat(path)
        return {key: getattr(found, key) for key in
                ("st_atime", "st_ctime", "st_gid", "st_mode", "st_mtime", "st_nlink", "st_size", "st_uid", "st_ino", "st_blocks")}

    def readdir(self, path, handle):
        return [".", "..", *os.listdir(path)]

    def readlink(self, path):
        return os.readlink(path)

    def access(self, path, mode):
        if not os.access(path, mode):
            raise fusepy.FuseOSError(errno.EACCES)

    def statfs(self, path):
        found = os.statvfs(path)
        return {key: getattr(found, key) for key in
                ("f_bavail", "f_bfree", "f_blocks", "f_bsize", "f_favail", "f_ffree", "f_files", "f_flag", "f_frsize", "f_namemax")}

    def mkdir(self, path, mode):
        os.mkdir(path, mode)

    def rmdir(self, path):
        os.rmdir(path)

    def unlink(self, path):
        os.unlink(path)

    def rename(self, path, new):
        os.rename(path, self.folder + new)

    def symlink(self, path, target):
        os.symlink(target, path)

    def link(self, path, target):
        raise fusepy.FuseOSError(errno.EPERM)

    def chmod(self, path, mode):
        os.chmod(path, mode)

    def chown(self, path, uid, gid):
        os.lchown(path, uid, gid)

    def utimens(self, path, times=None):
        os.utime(path, times)

    def open(self, path, flags):
        return os.open(path, flags & ~os.O_APPEND)

    def create(self, path, mode, fi=None):
        return os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC, mode)

    def read(self, path, size, offset, handle):
        return os.pread(handle, size, offset)

    def write(self, path, data, offset, handle):
        return os.pwrite(handle, data, offset)

    def truncate(self, path, length, handle=None):
        if handle is not None:
            os.ftruncate(handle, length)
        else:
            os.truncate(path, length)

    def flush(self, path, handle):
        pass

    def fsync(self, path, datasync, handle):
        pass

    def release(self, path, handle):
        os.close(handle)

    def lock(self, path, handle, command, lock):
        if self.no_locks:
            raise fusepy.FuseOSError(errno.ENOLCK)
        return 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("place")
    parser.add_argument("--delay-ms", type=float, default=0)
    parser.add_argument("--no-locks", action="store_true")
    parser.add_argument("--fail", default="")
    parser.add_argument("--lost", default="")
    parser.add_argument("--counts", default="")
    arguments = parser.parse_args()
    fusepy.FUSE(RemoteFolder(arguments.folder, arguments), arguments.place, foreground=True, direct_io=True, big_writes=True,
                hard_remove=True, use_ino=True, attr_timeout=1, entry_timeout=1)


if __name__ == "__main__":
    main()
