go_home()
return
go_home()
